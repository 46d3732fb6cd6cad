#include "serve/room.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

#include "base/sha256.h"
#include "io/report/report_page.h"
#include "io/report/result_folder.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::chrono::milliseconds kFresh(500);
constexpr std::size_t kNewest = 500;

Json json_of(const ListedSession& session) {
  return {{"session", session.name},    {"patient", session.patient}, {"acquired", session.times},
          {"verdict", session.verdict}, {"action", session.action},   {"state", session.state}};
}

Json json_of(const std::optional<EngineSeen>& engine) {
  Json waiting = Json::array();
  if (engine)
    for (const WaitingSession& one : engine->state.waiting)
      waiting.push_back({{"session", one.name},
                         {"patient", one.patient_id},
                         {"acquired", one.acquired},
                         {"verdict", one.has_failed ? "failed" : "waiting"},
                         {"action", ""},
                         {"state", one.why}});
  return waiting;
}

std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw NotThere(fmt::format("{}: cannot be read", path.string()));
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

Room::Room(const WatchFile& watch, const Clock& clock) : watch_(watch), clock_(clock), tree_(watch), list_(tree_) {}

// A result that cannot be read hides no other.
void Room::look() {
  const std::vector<std::string> there = tree_.sessions();
  const bool is_any_gone =
      std::ranges::any_of(known_, [&](const std::string& one) { return !std::ranges::binary_search(there, one); });
  if (is_any_gone) {
    list_ = SessionList(tree_);
    known_.clear();
  }
  std::vector<std::string> troubles;
  for (const std::string& session : there) {
    if (known_.contains(session)) continue;
    try {
      const SetupResult report = read_report(tree_.session(session));
      if (report.views.empty()) throw Error(fmt::format("session {}: its result names no views", session));
      list_.add(session, report, obstacle_to_release(tree_, session, report.verdict));
      known_.insert(session);
    } catch (const Error& error) {
      troubles.emplace_back(error.what());
    }
  }
  list_.update(tree_.objections());
  std::optional<EngineSeen> engine;
  try {
    engine = read_engine_state(tree_.path(), clock_.file_time());
  } catch (const Error& error) {
    troubles.emplace_back(error.what());
  }
  if (engine) std::ranges::copy(engine->state.troubles, std::back_inserter(troubles));
  auto seen = std::make_shared<Seen>();
  seen->does_engine_run = engine && engine->runs();
  Json sessions = Json::array();
  for (const ListedSession& one : list_.sessions()) {
    if (sessions.size() == kNewest) break;
    sessions.push_back(json_of(one));
  }
  seen->list = {{"site", watch_.site.name},
                {"engine", seen->does_engine_run ? "runs" : "stopped"},
                {"troubles", troubles},
                {"waiting", json_of(engine)},
                {"count", list_.sessions().size()},
                {"sessions", std::move(sessions)}};
  seen->version = sha256_of(seen->list.dump(-1, ' ', false, Json::error_handler_t::replace));
  seen_ = std::move(seen);
  seen_at_ = clock_.now();
}

std::shared_ptr<const Room::Seen> Room::seen() {
  const std::lock_guard lock(mutex_);
  if (!seen_ || clock_.now() - seen_at_ >= kFresh) look();
  return seen_;
}

const ListedSession& Room::listed(const std::string& session) const {
  const auto found = std::ranges::find(list_.sessions(), session, &ListedSession::name);
  if (found == list_.sessions().end()) throw NotThere(fmt::format("there is no session {}", session));
  return *found;
}

Json Room::session(const std::string& name) {
  const std::lock_guard lock(mutex_);
  look();
  const ListedSession& session = listed(name);
  Json json = json_of(session);
  const Objection objection = tree_.objection(name);
  const std::string obstacle = session.verdict == to_string(Verdict::kRejected)
                                   ? "The result was rejected: there is nothing to release."
                               : tree_.is_released(name) ? "The session has been released."
                                                         : "";
  json["obstacle"] = obstacle;
  json["objection"] = objection.words;
  json["newer_have_results"] = objection.newer_have_results;
  json["peers"] = watch_.names_of_peers();
  try {
    json["record"] = tree_.registered(name).sha256;
  } catch (const Error& error) {
    json["record"] = "";
    json["obstacle"] = error.what();
  }
  return json;
}

std::string Room::file(const std::string& session, const std::string& name) {
  const std::lock_guard lock(mutex_);
  look();
  (void)listed(session);
  const SessionRecord record = tree_.registered(session);
  const auto file = record.files.find(name);
  if (file == record.files.end()) throw NotThere(fmt::format("session {}: has no file {}", session, name));
  std::string content = content_of(tree_.session(session) / name);
  if (sha256_of(content) != file->second)
    throw Error(fmt::format("session {}: {} was changed since its registration", session, name));
  return content;
}

void Room::release(const std::string& session, const std::string& record, const std::string& user,
                   bool despite_objection) {
  const std::lock_guard lock(mutex_);
  if (tree_.registered(session).sha256 != record)
    throw Error(fmt::format("session {}: is not what was on the screen any more. Look at it again", session));
  tree_.release(session,
                {.by = user, .user = user_.name, .sudo_user = user_.sudo_user, .despite_objection = despite_objection},
                watch_.names_of_peers());
  seen_.reset();
}

void Room::audit(const std::string& event, const std::string& user, const std::string& session) {
  const std::lock_guard lock(mutex_);
  Json details = {{"by", user}};
  if (!session.empty()) details["session"] = session;
  tree_.audit(event, details);
  tree_.write_kept_audit();
}

}  // namespace isoshift
