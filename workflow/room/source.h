#pragma once
// The source of the files of many patients. Files arrive in any order, some twice, some broken.

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "io/dicom/notes.h"
#include "io/study/study_files.h"
#include "workflow/room/clock.h"

namespace isoshift {

struct Patient {
  StudyFiles files;
  Clock::Time last;  // when the last of these files arrived
};

class Source {
 public:
  virtual ~Source() = default;

  // Takes the files that have arrived since the last call. Throws Error if the source does not answer, or if the disk
  // is full; the next call continues.
  virtual void update(Notes& notes) = 0;

  // By PatientID.
  virtual const std::map<std::string, Patient>& patients() const = 0;

  // Messages on files that cannot be read now, each beginning with the file's path. They may be of any patient.
  virtual std::vector<std::string> unreadable() const = 0;

  // Whether a file of this patient may be arriving now. A file whose patient is not known yet may be of this patient.
  virtual bool is_coming(const std::string& patient_id) const = 0;

  // Says that files of this patient are missing: the next update() fetches files that were forgotten.
  virtual void ask_for_rest(const std::string& patient_id) = 0;

  // Removes the kept files of every patient of whom no file has arrived since `time`, but for the patients `but`, by
  // PatientID. Files of other programs are not touched.
  virtual void forget_before(std::filesystem::file_time_type time, const std::set<std::string>& but) = 0;
};

}  // namespace isoshift
