#include "workflow/room/input_changes.h"

#include <fmt/format.h>

#include "base/error.h"
#include "workflow/room/session_record.h"

namespace isoshift {

void InputChanges::look(const std::map<std::string, Patient>& patients,
                        const std::function<bool(const std::string& patient_id, Clock::Time last)>& is_quiet,
                        const std::function<void(const std::string& session, const std::string& what)>& found) {
  for (const auto& [patient_id, patient] : patients) {
    if (compared_[patient_id] == patient.last || !is_quiet(patient_id, patient.last)) continue;
    for (const std::string& session : grouping_.registered_in(patient.files)) {
      bool can_be_registered = true;
      const auto what = change_of(session, patient, can_be_registered);
      if (!what) continue;
      found(tree_.newest_of_same_xrays(session), *what);
      if (can_be_registered) changed_[session] = {.patient_id = patient_id, .what = *what};
    }
    compared_[patient_id] = patient.last;
  }
}

std::optional<std::string> InputChanges::change_of(const std::string& session, const Patient& patient,
                                                   bool& can_be_registered) {
  const std::optional<SessionInputs> before = tree_.inputs(session);
  const std::optional<SessionFiles> xrays = grouping_.registered_session(session, patient.files);
  if (!before || !xrays) return std::nullopt;
  const StudyFiles own = grouping_.files_of(*xrays, patient.files);
  if (!grouping_.missing_of(*xrays, own).empty()) return std::nullopt;
  try {
    const SessionInputs now = inputs_of(choose_parts(own), contents_, *before);
    const std::string parts = what_changed(*before, now);
    if (!parts.empty()) return fmt::format("{} changed after the registration", parts);
    if (now != *before) tree_.keep_inputs(tree_.newest_of_same_xrays(session), now);
    return std::nullopt;
  } catch (const Error& error) {  // several plans, for one
    can_be_registered = false;
    return fmt::format("files came after the registration: {}", error.what());
  }
}

std::vector<SessionFiles> InputChanges::to_register(const std::string& patient_id, const StudyFiles& files) const {
  std::vector<SessionFiles> sessions;
  for (const auto& [first, changed] : changed_) {
    if (changed.patient_id != patient_id) continue;
    auto again = grouping_.registered_session(first, files);
    if (!again) continue;
    again->name = tree_.further_name(first);
    again->remarks.push_back(fmt::format("is registered again: {}", changed.what));
    sessions.push_back(*std::move(again));
  }
  return sessions;
}

void InputChanges::registered(const std::string& session) { changed_.erase(name_of_xrays(session)); }

}  // namespace isoshift
