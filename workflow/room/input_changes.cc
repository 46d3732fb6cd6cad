#include "workflow/room/input_changes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <set>

#include "base/error.h"
#include "workflow/room/session_record.h"

namespace isoshift {
namespace {

bool is_ascii(const std::string& text) {
  return std::ranges::all_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x80; });
}

}  // namespace

void InputChanges::add_result(const std::string& session, const std::string& patient_id) {
  patient_of_[name_of_xrays(session)] = patient_id;
}

void InputChanges::remove(const std::string& first_session) {
  patient_of_.erase(first_session);
  ambiguous_.erase(first_session);
  changed_.erase(first_session);
}

void InputChanges::look(const std::map<std::string, Patient>& patients,
                        const std::function<bool(const std::string& patient_id, Clock::Time last)>& is_quiet,
                        const Found& found) {
  for (const auto& [patient_id, patient] : patients) {
    if (is_compared(patient_id, patients) || !is_quiet(patient_id, patient.last)) continue;
    for (const std::string& session : grouping_.registered_in(patient.files))
      look_at(session, patient_id, patient, found);
    look_for_plans_of(patient_id, patients, found);
    compared_[patient_id] = patient.last;
  }
}

bool InputChanges::is_compared(const std::string& patient_id, const std::map<std::string, Patient>& patients) const {
  const auto patient = patients.find(patient_id);
  const auto compared = compared_.find(patient_id);
  return patient == patients.end() || (compared != compared_.end() && compared->second == patient->second.last);
}

void InputChanges::look_at(const std::string& session, const std::string& patient_id, const Patient& patient,
                           const Found& found) {
  ambiguous_.erase(session);
  bool can_be_registered = true;
  const auto what = change_of(session, patient_id, patient, can_be_registered);
  if (!what) return;
  found(tree_.newest_of_same_xrays(session), *what);
  if (can_be_registered)
    changed_[session] = {.patient_id = patient_id, .what = *what};
  else
    ambiguous_[session] = patient_id;
}

std::optional<std::string> InputChanges::change_of(const std::string& session, const std::string& patient_id,
                                                   const Patient& patient, bool& can_be_registered) {
  if (has_moved_to(patient_id, session, patient.files))
    return fmt::format("X-rays of it belong to patient {} now", patient_id);
  const std::optional<SessionInputs> before = tree_.inputs(session);
  const std::optional<SessionFiles> xrays = grouping_.registered_session(session, patient.files);
  if (!before || !xrays) return std::nullopt;
  const StudyFiles own = grouping_.files_of(*xrays, patient.files);
  if (!grouping_.missing_of(*xrays, own).empty()) return std::nullopt;
  try {
    if (const auto news = grouping_.came_after_choice(*xrays, patient.files); !news.empty())
      throw Error(fmt::format("a person had chosen before {} came", fmt::join(news, " and ")));
    const SessionInputs now = inputs_of(choose_parts(own), contents_, *before);
    const std::string parts = what_changed(*before, now);
    if (!parts.empty()) return fmt::format("{} changed after the registration", parts);
    if (now != *before) tree_.keep_inputs(tree_.newest_of_same_xrays(session), now);
  } catch (const Error& error) {  // several plans, for one
    can_be_registered = false;
    return fmt::format("files came after the registration: {}", error.what());
  }
  if (std::string choice = grouping_.choice_in_words(session); !choice.empty() && !rests_on(session, choice))
    return choice;
  return std::nullopt;
}

// Whether the X-rays' present registration was ordered with this choice.
bool InputChanges::rests_on(const std::string& session, const std::string& choice) const {
  try {
    const std::vector<std::string> doubts = tree_.order(session).parts.doubts;
    return std::ranges::find(doubts, choice) != doubts.end();
  } catch (const Error&) {  // nobody kept how it was registered
    return true;
  }
}

// Whether X-rays of a result were rewritten, and have another patient's ID now. One that was registered although its ID
// is another one than that of the result is as it was.
bool InputChanges::has_moved_to(const std::string& patient_id, const std::string& session,
                                const StudyFiles& files) const {
  const auto registered_for = patient_of_.find(session);
  if (registered_for == patient_of_.end() || registered_for->second == patient_id ||
      !is_ascii(registered_for->second) || !is_ascii(patient_id))  // others may read differently in a result
    return false;
  const std::optional<SessionInputs> before = tree_.inputs(session);
  if (!before) return false;
  StudyParts parts;
  const std::map<std::string, std::string> results = grouping_.results_of(files);
  for (const auto* images : {&files.images, &files.other_xrays})
    for (const StudyFiles::Image& image : *images)
      if (const auto found = results.find(image.sop_instance_uid); found != results.end() && found->second == session)
        parts.images.push_back(image.file);
  return before->parts.back().contents != inputs_of(parts, contents_, *before).parts.back().contents;
}

// Plans of this patient that X-rays of other patients' results name, and that these patients have no more.
void InputChanges::look_for_plans_of(const std::string& patient_id, const std::map<std::string, Patient>& patients,
                                     const Found& found) const {
  std::set<std::string> plans;
  for (const StudyFiles::Plan& plan : patients.at(patient_id).files.plans) plans.insert(plan.sop_instance_uid);
  for (const auto& [other, patient] : patients) {
    if (plans.empty() || other == patient_id) continue;
    std::set<std::string> moved = plans;
    for (const StudyFiles::Plan& plan : patient.files.plans) moved.erase(plan.sop_instance_uid);
    StudyFiles of_moved;
    std::ranges::copy_if(patient.files.images, std::back_inserter(of_moved.images),
                         [&](const StudyFiles::Image& image) { return moved.contains(image.plan_uid); });
    if (of_moved.images.empty()) continue;
    for (const std::string& session : grouping_.registered_in(of_moved))
      found(tree_.newest_of_same_xrays(session), fmt::format("its RT Plan belongs to patient {} now", patient_id));
  }
}

std::vector<SessionFiles> InputChanges::ambiguous_in(const std::string& patient_id, const StudyFiles& files) const {
  std::vector<SessionFiles> sessions;
  for (const auto& [first, of_patient] : ambiguous_)
    if (of_patient == patient_id)
      if (auto session = grouping_.registered_session(first, files)) sessions.push_back(*std::move(session));
  return sessions;
}

bool InputChanges::is_to_be_registered(const std::string& session) const {
  return changed_.contains(name_of_xrays(session));
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
