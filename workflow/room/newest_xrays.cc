#include "workflow/room/newest_xrays.h"

#include <algorithm>

namespace isoshift {
namespace {

constexpr const char* kUnknown = "~";  // sorts behind every date

}  // namespace

void NewestXrays::add_result(const std::string& session, const std::string& patient_id, const std::string& last) {
  results_[session] = {.patient_id = patient_id, .last = last};
  Xrays& newest = newest_result_[patient_id];
  newest = std::max(newest, {.last = last, .session = session});
}

void NewestXrays::set_waiting(const std::vector<WaitingSession>& waiting) {
  waits_.clear();
  for (const WaitingSession& one : waiting) {
    Xrays& newest = waits_[one.patient_id];
    newest = std::max(newest, {.last = one.last.empty() ? kUnknown : one.last, .session = one.name});
  }
}

std::string NewestXrays::newer_than(const std::string& session) const {
  const auto result = results_.find(session);
  if (result == results_.end()) return "";
  const auto& [patient_id, last] = result->second;
  for (const auto* newest : {&waits_, &newest_result_})
    if (const auto found = newest->find(patient_id); found != newest->end() && found->second.last > last)
      return found->second.session;
  return "";
}

}  // namespace isoshift
