#pragma once
// The files of a folder, and which of them belong together.

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/dicom/notes.h"
#include "io/dicom/table_read_outs.h"

namespace isoshift {

// The files below some paths, sorted by kind, with the references that tell which of them belong together.
struct StudyFiles {
  struct Ct {
    std::string patient;  // PatientID\issuer
    std::string series_instance_uid;
    std::string label;  // SeriesDescription and SeriesDate, for people; empty: neither
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
    std::string label;              // RTPlanLabel and RTPlanDate, for people; empty: neither
  };
  static constexpr double kLargestUtcOffsetS = 14 * 3600.0;
  struct Image {
    std::filesystem::path file;
    std::string patient;
    std::string sop_instance_uid;
    std::string plan_uid;         // ReferencedRTPlanSequence
    std::string label;            // RTImageLabel; empty: none
    std::string machine;          // RadiationMachineName; empty: unknown
    std::optional<double> at_s;   // when it was acquired, since an epoch
    bool has_utc_offset = false;  // of at_s; else the time is local, and up to kLargestUtcOffsetS off
    std::string acquired;         // the same for people, "2026-03-01 10:15:00"; empty: unknown
    std::optional<int> fraction;  // FractionNumber
    TableReadOuts table;
    std::filesystem::path other = {};  // a file with this SOPInstanceUID and other contents; empty: none
  };
  struct Structures {
    std::filesystem::path file;
    std::string patient;
    std::string sop_instance_uid;
    std::set<std::string> ct_series_uids;           // of the images it was drawn on
    std::set<std::string> ct_sop_instance_uids;     // of these images
    std::set<std::string> frame_of_reference_uids;  // of its structures
    bool has_contours = false;                      // closed ones: it can hold a target
  };

  std::vector<Ct> cts;
  std::vector<Plan> plans;
  std::vector<Image> images;       // RT Images
  std::vector<Image> drrs;         // RT Images that say that they were computed; X-rays where there are no others
  std::vector<Image> other_xrays;  // DX, CR, XA: their files do not contain the geometry
  std::vector<Structures> structures;
  std::vector<std::filesystem::path> registrations;  // Spatial Registration objects, also deformable ones
  std::vector<std::string> left_aside;               // "FILE: reason"
  std::vector<std::string> other_formats;            // those of them that are X-rays in no DICOM format
  std::vector<std::string> unreadable;               // messages on files that look like DICOM, or cannot be opened
};

// The PatientID, without the issuer, of a `patient` of StudyFiles.
std::string patient_id_of(const std::string& patient);
// Whether two `patient`s of one PatientID may be one: their issuers are the same, or one names none.
bool may_be_of_one_issuer(const std::string& a, const std::string& b);

// Reads the headers of all files below `paths` (files or folders), in the order of their names. A file that is not
// DICOM is left aside.
StudyFiles scan_study(const std::vector<std::filesystem::path>& paths);

// Reads the header of one file. Throws Error if the file cannot be read.
StudyFiles scan_file(const std::filesystem::path& path);

// The DRRs of patients who have X-rays, as they are left aside: "FILE: reason".
std::vector<std::string> drrs_left_aside(const StudyFiles& files);
// The RT Images that count: DRRs only of patients who have no X-ray.
std::vector<StudyFiles::Image> counting_images(const StudyFiles& files);

// Adds the files of `from` to `files`.
void merge(StudyFiles from, StudyFiles& files);

// Which session of X-rays is meant, where a folder holds several: that which has all that is told here. No value at
// all: the folder holds one.
struct SessionChoice {
  std::string name;             // as SessionFiles has it, or its beginning
  std::string date;             // "2026-03-01"
  std::optional<int> fraction;  // FractionNumber of its X-rays
  bool is_latest = false;       // of those that fit

  bool is_made() const { return !name.empty() || !date.empty() || fraction || is_latest; }
  bool operator==(const SessionChoice&) const = default;
};

// The structure sets that are there, where none with contours is used.
struct UnusedStructures {
  // With contours, and nothing tells which one is meant; or, where none is on the CT, of CTs that are not here.
  std::vector<std::filesystem::path> rivals;
  std::vector<std::filesystem::path> unusable;  // drawn on another CT, or without closed contours

  bool operator==(const UnusedStructures&) const = default;
};

// "the study holds no RT Structure Set", or what else is true.
std::string why_no_structures(const UnusedStructures& unused);

// The files of one registration: the parts that a person or a manifest names, or the parts that were found. A path or a
// list that is empty names nothing.
struct StudyParts {
  std::filesystem::path study;  // folder in which the parts that are not named are searched for
  SessionChoice session;        // among the X-rays of that folder
  std::vector<std::filesystem::path> ct, images;
  std::filesystem::path plan, structures;
  UnusedStructures unused_structures;  // where `structures` is empty, or has no contours
  std::vector<std::string> doubts;     // why the images may not show one setup: then the result needs a person's review

  std::vector<std::filesystem::path> paths() const;  // all that are named

  bool operator==(const StudyParts&) const = default;
};

// Finds the parts of a study:
// - the plan to which the images refer;
// - the CT in the plan's frame of reference, and of several such CTs the one on which the plan's structure set was
// drawn;
// - the images of that plan, and of the session that `named` chooses;
// - the structure set to which the plan refers, or else the only structure set that was drawn on that CT. Those without
// closed contours count only where no other is there.
// All other files are left aside in the notes, with the reason; so are DRRs, unless there is no other X-ray.
// `takes_other_xrays`: a machine profile supplies the geometry of X-rays that are not RT Images. Throws Error if there
// is no CT or no image, or if the files do not tell which of several candidates is meant. Several structure sets are
// rivals: an error where a structure set is needed, and a doubt about a target that nobody names.
StudyParts find_parts(const StudyParts& named, bool takes_other_xrays, Notes& notes);

// The same, with all scanned files as candidates.
StudyParts choose_parts(const StudyFiles& files);

}  // namespace isoshift
