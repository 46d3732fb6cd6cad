#pragma once
// Results whose files have changed since: late slices, a revised plan, a replaced X-ray, X-rays or a plan that belong
// to another patient now, or another choice of a person.

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
  using Found = std::function<void(const std::string& session, const std::string& what)>;

  // All of these must live longer than this.
  InputChanges(ResultsTree& tree, const Grouping& grouping, const FileContents& contents)
      : tree_(tree), grouping_(grouping), contents_(contents) {}

  // `patient_id`: that of the result.
  void add_result(const std::string& session, const std::string& patient_id);
  // Forgets all results of these X-rays.
  void remove(const std::string& first_session);

  // Compares the files of results with those from which they were made, once after all news of a patient have come.
  // Calls `found` for each result whose files are others now, with what has changed in words.
  void look(const std::map<std::string, Patient>& patients,
            const std::function<bool(const std::string& patient_id, Clock::Time last)>& is_quiet, const Found& found);

  // Whether that was done since the last news of a patient have come. Of a patient who has left the source there are
  // none.
  bool is_compared(const std::string& patient_id, const std::map<std::string, Patient>& patients) const;

  // Compares a patient's results again: what a person has chosen may have changed.
  void compare_again(const std::string& patient_id) { compared_.erase(patient_id); }

  // The results of a patient whose files do not tell any more from what they would be registered.
  std::vector<SessionFiles> ambiguous_in(const std::string& patient_id, const StudyFiles& files) const;
  // Whether a session is to be registered again.
  bool is_to_be_registered(const std::string& session) const;
  // The sessions of a patient that are to be registered again, each under the name of its next result.
  std::vector<SessionFiles> to_register(const std::string& patient_id, const StudyFiles& files) const;
  // That was done. `session`: any result of the X-rays.
  void registered(const std::string& session);

 private:
  struct Changed {
    std::string patient_id;  // in the source
    std::string what;        // in words
  };
  void look_at(const std::string& session, const std::string& patient_id, const Patient& patient, const Found& found);
  // What has changed. Files that have left the source tell nothing.
  std::optional<std::string> change_of(const std::string& session, const std::string& patient_id,
                                       const Patient& patient, bool& can_be_registered);
  bool rests_on(const std::string& session, const std::string& choice) const;
  bool has_moved_to(const std::string& patient_id, const std::string& session, const StudyFiles& files) const;
  void look_for_plans_of(const std::string& patient_id, const std::map<std::string, Patient>& patients,
                         const Found& found) const;

  ResultsTree& tree_;
  const Grouping& grouping_;
  const FileContents& contents_;
  std::map<std::string, Changed> changed_;         // by the first session of the X-rays
  std::map<std::string, std::string> patient_of_;  // PatientID, by the first session of the X-rays
  std::map<std::string, std::string> ambiguous_;   // PatientID in the source, by the first session of the X-rays
  std::map<std::string, Clock::Time> compared_;    // Patient::last at that time, by PatientID in the source
};

}  // namespace isoshift
