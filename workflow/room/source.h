#pragma once
// Where the files of many patients come from: in any order, some twice, some broken.

#include <filesystem>
#include <map>
#include <string>

#include "io/dicom/notes.h"
#include "io/study/study_files.h"
#include "workflow/room/clock.h"

namespace isoshift {

struct Patient {
  StudyFiles files;
  Clock::Time last;  // when one of them came last
};

class Source {
 public:
  virtual ~Source() = default;

  // Takes what has come since the last call. Throws Error for a source that cannot be asked now, or a disk that is
  // full; the next call goes on.
  virtual void update(Notes& notes) = 0;

  // By PatientID.
  virtual const std::map<std::string, Patient>& patients() const = 0;

  // Whether something of this patient may be on its way. Files of an unknown patient may be of this one.
  virtual bool is_coming(const std::string& patient_id) const = 0;

  // Files of this patient are missing: the next update() looks for those that were forgotten.
  virtual void ask_for_rest(const std::string& patient_id) = 0;

  // Removes the files kept here of every patient of whom nothing has come since. What another program keeps is not
  // touched.
  virtual void forget_before(std::filesystem::file_time_type time) = 0;
};

}  // namespace isoshift
