#pragma once
// Which files there are, of which patients: each object (SOPInstanceUID) once.

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/dicom/notes.h"
#include "io/study/study_files.h"
#include "workflow/room/source.h"

namespace isoshift {

struct KnownFile {
  std::string patient_id, uid;  // SOPInstanceUID
};

// Of what scan_file() found; nothing for a file that is no part of a study.
std::optional<KnownFile> known_file_in(const StudyFiles& one);

class PatientFiles {
 public:
  explicit PatientFiles(const Clock& clock) : clock_(clock) {}

  const std::map<std::string, Patient>& patients() const { return patients_; }  // by PatientID
  const std::map<std::filesystem::path, KnownFile>& known() const { return known_; }

  struct Taken {
    bool is_readable = true;
    std::optional<std::filesystem::path> replaced;  // a broken file of the same object: its place is taken
    std::vector<std::filesystem::path> copies;      // as forget() returns them, of files that were forgotten
  };
  // Reads a file, in place of what was read under this name before. A whole file of an object that is known is left
  // out; if the contents differ, a warning says so.
  Taken take(const std::filesystem::path& file, Notes& notes);

  // Returns the files that were left out as copies of this one: take() one of them in its place.
  std::vector<std::filesystem::path> forget(const std::filesystem::path& file);

  // A file that was left out is gone.
  void forget_copy(const std::filesystem::path& file);

 private:
  const Clock& clock_;
  std::map<std::string, Patient> patients_;
  std::map<std::filesystem::path, KnownFile> known_;
  std::map<std::string, std::filesystem::path> file_of_uid_;     // of those known
  std::multimap<std::string, std::filesystem::path> copies_of_;  // of a SOPInstanceUID, left out
};

}  // namespace isoshift
