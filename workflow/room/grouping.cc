#include "workflow/room/grouping.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/sha256.h"
#include "workflow/room/session_record.h"

namespace isoshift {
namespace {

template <class Do>
void for_each_xray(const StudyFiles& files, Do&& act) {
  for (const auto* images : {&files.images, &files.other_xrays})
    for (const StudyFiles::Image& image : *images) act(image.sop_instance_uid);
}

}  // namespace

void Grouping::add_result(const std::string& session, const std::set<std::string>& xrays) {
  results_[name_of_xrays(session)] = xrays;
  registered_.insert(xrays.begin(), xrays.end());
  for (const std::string& uid : xrays) session_of_[uid] = name_of_xrays(session);
}

void Grouping::add_deleted(const std::set<std::string>& sha256) { deleted_.insert(sha256.begin(), sha256.end()); }

void Grouping::remove(const std::string& session) {
  results_.erase(name_of_xrays(session));
  for (auto& [uid, of] : session_of_)
    if (of == name_of_xrays(session)) of.clear();
}

bool Grouping::is_regrouped(const std::string& session) const {
  const Choice* const choice = choice_for(session);
  return choice != nullptr && choice->is_regrouped;
}

void Grouping::see(const StudyFiles& files) {
  if (deleted_.empty()) return;
  for_each_xray(files, [&](const std::string& uid) {
    if (registered_.contains(uid) || !deleted_.contains(sha256_of(uid))) return;
    registered_.insert(uid);
    session_of_[uid] = "";
  });
}

bool Grouping::are_all_registered(const StudyFiles& files) const {
  const auto is_registered = [&](const StudyFiles::Image& image) {
    return registered_.contains(image.sop_instance_uid);
  };
  return std::ranges::all_of(files.images, is_registered) &&
         (!takes_other_xrays_ || std::ranges::all_of(files.other_xrays, is_registered));
}

std::vector<SessionFiles> Grouping::sessions_in(const StudyFiles& files) const {
  std::vector<SessionFiles> sessions;
  std::set<std::string> taken = registered_;
  for (const auto& [name, choice] : choices_) {
    if (choice.is_withdrawn || results_.contains(name)) continue;
    auto session = chosen_session(choice, files, takes_other_xrays_, registered_);
    if (!session) continue;
    for (const StudyFiles::Image& image : session->images) taken.insert(image.sop_instance_uid);
    sessions.push_back(*std::move(session));
  }
  std::ranges::move(sessions_of(files, takes_other_xrays_, taken), std::back_inserter(sessions));
  return sessions;
}

std::vector<SessionFiles> Grouping::chosen_in(const StudyFiles& files) const {
  std::vector<SessionFiles> sessions;
  for (const auto& [name, choice] : choices_)
    if (results_.contains(name))
      if (auto session = chosen_session(choice, files, takes_other_xrays_, registered_))
        sessions.push_back(*std::move(session));
  return sessions;
}

std::set<std::string> Grouping::registered_in(const StudyFiles& files) const {
  std::set<std::string> xrays, sessions;
  for_each_xray(files, [&](const std::string& uid) { xrays.insert(uid); });
  for (const auto& [session, own] : results_)
    if (std::ranges::any_of(own, [&](const std::string& uid) { return xrays.contains(uid); })) sessions.insert(session);
  return sessions;
}

std::map<std::string, std::string> Grouping::results_of(const StudyFiles& files) const {
  std::map<std::string, std::string> found;
  for_each_xray(files, [&](const std::string& uid) {
    if (const auto session = session_of_.find(uid); session != session_of_.end() && !session->second.empty())
      found.insert(*session);
  });
  return found;
}

std::optional<SessionFiles> Grouping::registered_session(const std::string& session, const StudyFiles& files) const {
  if (const Choice* const choice = choice_for(session))
    return chosen_session(*choice, files, takes_other_xrays_, registered_);
  const auto own = results_.find(session);
  std::set<std::string> others = registered_;
  if (own != results_.end())
    for (const std::string& uid : own->second) others.erase(uid);
  for (SessionFiles& found : sessions_of(files, takes_other_xrays_, others))
    if (found.name == session) return std::move(found);
  return std::nullopt;
}

const Choice* Grouping::choice_for(const std::string& session) const {
  const auto found = choices_.find(name_of_xrays(session));
  return found == choices_.end() || found->second.is_withdrawn ? nullptr : &found->second;
}

std::string Grouping::choice_in_words(const std::string& session) const {
  const Choice* const choice = choice_for(session);
  return choice == nullptr ? "" : in_words(*choice);
}

std::vector<std::string> Grouping::came_after_choice(const SessionFiles& session, const StudyFiles& files) const {
  const Choice* const choice = choice_for(session.name);
  if (choice == nullptr || choice->offered.empty()) return {};
  const SessionOptions now = options_of(session, files);
  std::vector<std::string> words;
  for (const auto* candidates : {&now.plans, &now.cts})
    for (const Candidate& candidate : *candidates)
      if (!choice->offered.contains(candidate.id)) words.push_back(candidate.words);
  return words;
}

StudyFiles Grouping::files_of(const SessionFiles& session, const StudyFiles& files) const {
  StudyFiles own = files_for(session, files);
  const Choice* const choice = choice_for(session.name);
  return choice == nullptr ? own : as_chosen(std::move(own), *choice);
}

std::vector<std::string> Grouping::missing_of(const SessionFiles& session, const StudyFiles& own) const {
  std::vector<std::string> missing = missing_parts(own);
  if (const Choice* const choice = choice_for(session.name))
    if (std::string chosen = isoshift::missing_of(*choice, own); !chosen.empty()) missing.push_back(std::move(chosen));
  return missing;
}

std::vector<std::string> Grouping::flags_of(const SessionFiles& session) const {
  const Choice* const choice = choice_for(session.name);
  return choice == nullptr ? std::vector<std::string>() : flags_for(*choice, session);
}

SessionOptions Grouping::options_of(const SessionFiles& session, const StudyFiles& files) const {
  return isoshift::options_of(session, files_for(session, files), files, takes_other_xrays_, session_of_,
                              choice_for(session.name));
}

}  // namespace isoshift
