#pragma once
// The known files of each patient, with each object (SOPInstanceUID) once.

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

// From the result of scan_file(); nothing for a file that is not a CT image, plan, structure set or X-ray.
std::optional<KnownFile> known_file_in(const StudyFiles& one);

class PatientFiles {
 public:
  explicit PatientFiles(const Clock& clock) : clock_(clock) {}

  const std::map<std::string, Patient>& patients() const { return patients_; }  // by PatientID
  const std::map<std::filesystem::path, KnownFile>& known() const { return known_; }
  // Why files cannot be read, by file.
  const std::map<std::filesystem::path, std::string>& unreadable() const { return unreadable_; }

  struct Taken {
    std::optional<std::filesystem::path> replaced;  // a broken file of the same object, which this file replaces
    bool differs = false;                           // from the known file of the same object
    std::vector<std::filesystem::path> copies;      // what forget() returned for files that were forgotten
  };
  // Reads a file, and forgets an earlier version of it. If another complete file of the same object is known, the new
  // file is not used; if the contents differ, a warning says so.
  Taken take(const std::filesystem::path& file, Notes& notes);

  // Forgets a file. Returns the files that were not used because they are copies of it: take() one of them in its
  // place.
  std::vector<std::filesystem::path> forget(const std::filesystem::path& file);

  // Forgets a copy that was not used and has been removed, even if its contents differed.
  void forget_copy(const std::filesystem::path& file);

 private:
  const Clock& clock_;
  std::map<std::string, Patient> patients_;
  std::map<std::filesystem::path, KnownFile> known_;
  std::map<std::filesystem::path, std::string> unreadable_;
  std::map<std::string, std::filesystem::path> file_of_uid_;     // the known file, by SOPInstanceUID
  std::multimap<std::string, std::filesystem::path> copies_of_;  // files that are not used, by SOPInstanceUID
};

}  // namespace isoshift
