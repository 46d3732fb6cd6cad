#pragma once
// Results whose files have changed since: late slices, a revised plan, a replaced X-ray.

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/study/session_files.h"
#include "workflow/room/grouping.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/session_inputs.h"
#include "workflow/room/source.h"

namespace isoshift {

class InputChanges {
 public:
  // All of these must live longer than this.
  InputChanges(ResultsTree& tree, const Grouping& grouping, const FileContents& contents)
      : tree_(tree), grouping_(grouping), contents_(contents) {}

  // Compares the files of results with those from which they were made, once after all news of a patient have come.
  // Calls `found` for each result whose files are others now, with what has changed in words.
  void look(const std::map<std::string, Patient>& patients,
            const std::function<bool(const std::string& patient_id, Clock::Time last)>& is_quiet,
            const std::function<void(const std::string& session, const std::string& what)>& found);

  // Compares a patient's results again: what a person has chosen may have changed.
  void compare_again(const std::string& patient_id) { compared_.erase(patient_id); }

  // The sessions of a patient that are to be registered again, each under the name of its next result.
  std::vector<SessionFiles> to_register(const std::string& patient_id, const StudyFiles& files) const;
  // That was done. `session`: any result of the X-rays.
  void registered(const std::string& session);

 private:
  struct Changed {
    std::string patient_id;  // in the source
    std::string what;        // in words
  };
  // What has changed. Files that have left the source tell nothing.
  std::optional<std::string> change_of(const std::string& session, const Patient& patient, bool& can_be_registered);

  ResultsTree& tree_;
  const Grouping& grouping_;
  const FileContents& contents_;
  std::map<std::string, Changed> changed_;       // by the first session of the X-rays
  std::map<std::string, Clock::Time> compared_;  // Patient::last at that time, by PatientID in the source
};

}  // namespace isoshift
