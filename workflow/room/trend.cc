#include "workflow/room/trend.h"

#include <algorithm>
#include <set>
#include <utility>

#include "base/error.h"
#include "io/report/result_folder.h"
#include "setup/shown_shift.h"

namespace isoshift {
namespace {

std::string day_of(const ListedSession& session) { return session.first.substr(0, session.first.find(' ')); }

// Of the result alone. Throws Error if the tree is damaged.
std::string why_it_does_not_stand(const ResultsTree& tree, const std::string& session, Verdict verdict) {
  if (tree.newest_of_same_xrays(session) != session) return "its X-rays have a newer result";
  if (const auto decision = tree.decision(session); decision && decision->forbids())
    return "a person has decided against it";
  if (verdict == Verdict::kRejected) return "it was rejected";
  if (verdict == Verdict::kReview && !tree.is_released(session))
    return "it was not accepted, and nobody has released it";
  return "";
}

Trend::Result result_of(const ResultsTree& tree, ListedSession session) {
  Trend::Result result{.session = std::move(session), .plan = "", .components = {}, .level = {}, .left_out = ""};
  const std::string& name = result.session.name;
  try {
    check_unchanged(tree.registered(name), tree.session(name));
    const SetupResult found = read_report(tree.session(name));
    const ShownShift shown = shown_shift(found);
    result.plan = found.plan_label;
    result.components = shown_components(shown);
    if (found.site) result.level = found.site->level;
    result.left_out = why_it_does_not_stand(tree, name, found.verdict());
    if (!result.left_out.empty()) return result;
    if (!complete_components(shown)) result.left_out = "not all of its components are known";
    if (result.session.first.empty()) result.left_out = "the time of its X-rays is not known";
  } catch (const std::exception& error) {
    result.left_out = error.what();
  }
  return result;
}

}  // namespace

Trend trend_of(const ResultsTree& tree, std::vector<ListedSession> sessions) {
  std::ranges::stable_sort(sessions, {}, &ListedSession::first);
  Trend trend;
  std::set<std::string> days;
  std::vector<ErrorComponents> counted;
  for (ListedSession& session : sessions) {
    Trend::Result result = result_of(tree, std::move(session));
    if (result.left_out.empty() && !days.insert(day_of(result.session)).second)
      result.left_out = "an earlier result of this day counts";
    if (result.left_out.empty()) {
      ErrorComponents& components = counted.emplace_back();
      std::ranges::transform(result.components, components.begin(), [](const auto& one) { return one.value(); });
    }
    trend.results.push_back(std::move(result));
  }
  if (!counted.empty()) trend.errors = errors_of_patient(trend.results.front().session.patient, std::move(counted));
  return trend;
}

}  // namespace isoshift
