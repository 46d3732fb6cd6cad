#pragma once
// What a folder holds, and which of it belongs together.

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_set>
#include <vector>

#include "io/dicom/table_read_outs.h"

namespace isoshift {

// The files below some paths, sorted by what they are, with what tells which of them belong together.
struct StudyFiles {
  struct Ct {
    std::string patient;  // PatientID\issuer
    std::string series_instance_uid;
    std::string frame_of_reference_uid;
    std::vector<std::filesystem::path> files;
    std::set<std::string> sop_instance_uids;
  };
  struct Plan {
    std::filesystem::path file;
    std::string patient;
    std::string sop_instance_uid;
    std::string frame_of_reference_uid;
    std::string structure_set_uid;  // ReferencedStructureSetSequence
  };
  struct Image {
    std::filesystem::path file;
    std::string patient;
    std::string sop_instance_uid;
    std::string plan_uid;        // ReferencedRTPlanSequence
    std::string label;           // RTImageLabel; empty: none
    std::string machine;         // RadiationMachineName; empty: unknown
    std::optional<double> at_s;  // when it was acquired, since an epoch
    std::string acquired;        // the same for people, "2026-03-01 10:15:00"; empty: unknown
    TableReadOuts table;
  };
  struct Structures {
    std::filesystem::path file;
    std::string patient;
    std::string sop_instance_uid;
    std::set<std::string> ct_series_uids;           // of the images it was drawn on
    std::set<std::string> ct_sop_instance_uids;     // those images
    std::set<std::string> frame_of_reference_uids;  // of its structures
  };

  std::vector<Ct> cts;
  std::vector<Plan> plans;
  std::vector<Image> images;       // RT Images
  std::vector<Image> other_xrays;  // DX, CR, XA: their geometry is not in them
  std::vector<Structures> structures;
  std::vector<std::string> left_aside;  // "FILE: reason"
  std::vector<std::string> unreadable;  // why files that begin as DICOM, or cannot be opened, cannot be read
};

// The PatientID alone of what StudyFiles calls a patient.
std::string patient_id_of(const std::string& patient);

// All files below `paths` (files or folders) but those named and hidden ones (with a leading dot), in the order of
// their names. Throws Error for a path that is not there or cannot be searched.
// With `unsearchable` folders below them that cannot be searched are left out, and told there.
std::vector<std::filesystem::path> files_below(const std::vector<std::filesystem::path>& paths,
                                               const std::unordered_set<std::string>& but = {},
                                               std::set<std::filesystem::path>* unsearchable = nullptr);

// Reads the headers of all files below `paths` (files or folders), in the order of their names. A file that is no DICOM
// is left aside.
StudyFiles scan_study(const std::vector<std::filesystem::path>& paths);

// The same of one file. Throws Error for one that cannot be read.
StudyFiles scan_file(const std::filesystem::path& path);

// Adds what was scanned elsewhere.
void merge(StudyFiles from, StudyFiles& files);

// The parts of one registration.
struct StudyParts {
  std::vector<std::filesystem::path> ct;
  std::vector<std::filesystem::path> images;
  std::optional<std::filesystem::path> plan;
  std::optional<std::filesystem::path> structures;
  std::vector<std::string> left_aside;
};

// Which parts a person named; the others are searched for in `study`.
struct NamedParts {
  std::filesystem::path study;
  bool takes_other_xrays = false;  // a machine profile supplies the geometry of X-rays that are no RT Images
  std::vector<std::filesystem::path> ct;
  std::vector<std::filesystem::path> images;
  std::optional<std::filesystem::path> plan;
  std::optional<std::filesystem::path> structures;
};

// The plan that the images refer to, the CT in whose frame of reference (and, of several, on whose structure set) it
// was made, the images of that plan, and the structure set that the plan refers to, else the only one drawn on that CT.
// All else is left aside, with the reason. Throws Error where CT or images are absent or the files do not tell which of
// several is meant; nobody has to tell that of structure sets, unless they are wanted.
StudyParts find_parts(const NamedParts& named);

// The same among files that were scanned, all of them candidates.
StudyParts choose_parts(const StudyFiles& files);

}  // namespace isoshift
