#include "workflow/room/session_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "base/error.h"
#include "setup/shown_shift.h"

namespace isoshift {
namespace {

// Of anything with a label and a time.
template <class Xray>
std::string times_in_words(const std::vector<Xray>& xrays) {
  std::string words;
  for (const Xray& xray : xrays)
    words += fmt::format("{}{} {}", words.empty() ? "" : "; ", xray.label.empty() ? "X-ray" : xray.label,
                         xray.acquired.empty() ? "at an unknown time" : xray.acquired);
  return words;
}

}  // namespace

std::string times_of(const std::vector<StudyFiles::Image>& images) { return times_in_words(images); }
std::string times_of(const std::vector<SetupResult::View>& views) { return times_in_words(views); }

void SessionList::add(const std::string& session, const SetupResult& report, const std::string& obstacle,
                      const std::string& reason_for_person) {
  std::string held = "held";
  if (!obstacle.empty())
    held += ", cannot be released: " + obstacle;
  else if (!reason_for_person.empty())
    held += " for a person: " + reason_for_person;
  ListedSession added{.name = session,
                      .patient = fmt::format("{} ({})", report.identity.patient_name, report.identity.patient_id),
                      .verdict = std::string(to_string(report.verdict())),
                      .action = std::string(to_string(shown_shift(report).decision.action)),
                      .patient_key = isoshift::patient_key(report.identity),
                      .held = std::move(held),
                      .state = "",
                      .first = report.views.front().acquired,
                      .times = times_of(report.views)};
  sessions_.insert(std::ranges::upper_bound(sessions_, added.first, std::ranges::greater(), &ListedSession::first),
                   std::move(added));
}

bool SessionList::remove(const std::string& first_session) {
  return std::erase_if(sessions_,
                       [&](const ListedSession& session) { return name_of_xrays(session.name) == first_session; }) > 0;
}

// What people have decided, and a newer result of the same X-rays: "; ..." for each.
std::string SessionList::since_then(const std::string& session) const {
  std::string words;
  if (const std::string newest = tree_->newest_of_same_xrays(session); newest != session)
    words += "; superseded by session " + newest;
  try {
    if (const auto decision = tree_->decision(session)) words += "; " + in_words(*decision);
  } catch (const Error& error) {
    words += fmt::format("; {}", error.what());
  }
  return words;
}

std::string SessionList::release_of(const ListedSession& session, const Objection& objection, bool& is_over) const {
  if (session.verdict == to_string(Verdict::kRejected)) {
    is_over = true;
    return "rejected";
  }
  if (!tree_->is_released(session.name))
    return objection.words.empty() ? session.held : session.held + "; " + objection.words;
  try {
    const Release release = tree_->release_of(session.name).value();
    const auto left = tree_->pending_of(release).size();
    is_over = left == 0;
    std::string state = fmt::format("released by {} on {}{}", to_string(release.releaser), release.on,
                                    release.despite.empty() ? "" : ", although " + release.despite);
    if (left > 0) state += fmt::format("; {} to be sent", left);
    if (left == 0 && !release.peers.empty()) state += "; sent";
    return state;
  } catch (const std::exception& error) {
    return error.what();
  }
}

bool SessionList::update(const std::map<std::string, Objection>& objections) {
  bool has_changed = false;
  for (ListedSession& session : sessions_) {
    if (!session.is_over) {
      const auto objection = objections.find(session.name);
      session.release =
          release_of(session, objection == objections.end() ? Objection() : objection->second, session.is_over);
    }
    std::string state = session.release + since_then(session.name);
    has_changed |= std::exchange(session.state, state) != state;
  }
  return has_changed;
}

std::string obstacle_to_release(const ResultsTree& tree, const std::string& session, Verdict verdict) {
  try {
    const SessionRecord record = tree.registered(session);
    if (record.verdict == to_string(verdict)) return "";
    return fmt::format("session {}: its result says {}, the record of its registration {}: the result was changed",
                       session, to_string(verdict), record.verdict);
  } catch (const Error& error) {
    return error.what();
  }
}

}  // namespace isoshift
