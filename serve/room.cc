#include "serve/room.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

#include "base/sha256.h"
#include "io/report/result_folder.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::chrono::milliseconds kFresh(500);
constexpr std::size_t kNewest = 500;
constexpr const char* kReport = "report.html";

Json json_of(const ListedSession& session) {
  return {{"session", session.name},    {"patient", session.patient}, {"acquired", session.times},
          {"verdict", session.verdict}, {"action", session.action},   {"state", session.state}};
}

Json json_of(const std::optional<double>& number) { return number ? Json(*number) : Json(nullptr); }

Json json_of(const Trend& trend) {
  Json results = Json::array(), errors = nullptr;
  for (const Trend::Result& result : trend.results) {
    Json json = json_of(result.session);
    json["first"] = result.session.first;
    json["plan"] = result.plan;
    json["components"] = Json::array();
    for (const auto& component : result.components) json["components"].push_back(json_of(component));
    if (result.level)
      json["level"] = {{"translation_mm", json_of(result.level->translation_mm)},
                       {"rotation_deg", json_of(result.level->rotation_deg)}};
    json["left_out"] = result.left_out;
    results.push_back(std::move(json));
  }
  if (trend.errors)
    errors = {{"fractions", trend.errors->fractions.size()},
              {"systematic", trend.errors->mean},
              {"random", trend.errors->sd ? Json(*trend.errors->sd) : Json(nullptr)}};
  return {{"results", results}, {"errors", errors}};
}

// Without those that have a result since.
Json waiting_json(const EngineState& engine, const std::vector<ListedSession>& sessions) {
  Json waiting = Json::array();
  for (const WaitingSession& one : engine.waiting)
    if (std::ranges::find(sessions, one.name, &ListedSession::name) == sessions.end())
      waiting.push_back({{"session", one.name},
                         {"patient", one.patient_id},
                         {"acquired", one.acquired},
                         {"verdict", one.has_failed ? "failed" : "waiting"},
                         {"action", ""},
                         {"state", one.why},
                         {"has_options", one.options.is_anything()}});
  return waiting;
}

std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw NotThere(fmt::format("{}: cannot be read", path.string()));
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

Room::Room(const WatchFile& watch, const Clock& clock) : watch_(watch), clock_(clock), tree_(watch), list_(tree_) {
  check_is_owner(watch.results);
}

// A result that cannot be read hides no other. A session that was registered again is read again.
void Room::look_for_sessions(std::vector<std::string>& troubles) {
  std::map<std::string, RegisteredAt> there;
  for (const std::string& session : tree_.sessions()) there[session] = tree_.registered_at(session);
  const auto is_as_listed = [&](const auto& one) {
    const auto found = there.find(one.first);
    return found != there.end() && found->second == one.second;
  };
  if (!std::ranges::all_of(known_, is_as_listed)) {
    list_ = SessionList(tree_);
    known_.clear();
  }
  for (const auto& [session, registered_at] : there) {
    if (known_.contains(session)) continue;
    try {
      const SetupResult report = read_report(tree_.session(session));
      if (report.views.empty()) throw Error(fmt::format("session {}: its result names no views", session));
      list_.add(session, report, obstacle_to_release(tree_, session, report.verdict()));
      known_[session] = registered_at;
    } catch (const std::exception& error) {
      troubles.push_back(fmt::format("session {}: {}", session, error.what()));
    }
  }
}

void Room::look() {
  std::vector<std::string> troubles;
  look_for_sessions(troubles);
  std::optional<EngineSeen> engine;
  const auto attempt = [&](const auto& step) {
    try {
      step();
    } catch (const std::exception& error) {
      troubles.emplace_back(error.what());
    }
  };
  attempt([&] { list_.update(tree_.objections()); });
  attempt([&] { tree_.check_audit(); });
  attempt([&] { engine = read_engine_state(tree_.path(), clock_.file_time()); });
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
                {"waiting", waiting_json(engine ? engine->state : EngineState(), list_.sessions())},
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
  json["objection"] = "";
  json["peers"] = watch_.names_of_peers();
  json["record"] = "";
  json["obstacle"] = "";
  if (session.verdict == to_string(Verdict::kRejected))
    json["obstacle"] = "The result was rejected: there is nothing to release.";
  if (tree_.is_released(name)) json["obstacle"] = "The session has been released.";
  json["newest"] = tree_.newest_of_same_xrays(name);
  if (json["newest"] != name) json["obstacle"] = "The X-rays have a newer result.";
  if (tree_.is_handed_over(name)) json["obstacle"] = "A newer result by hand waits for the engine.";
  json["can_choose"] = can_choose(name);
  json["decision"] = nullptr;
  json["pose_set_by"] = "";
  try {
    json["objection"] = tree_.objection(name).words;
    const SessionRecord record = tree_.registered(name);
    json["record"] = record.sha256;
    json["pose_set_by"] = record.pose_set_by;
    json["decision"] = {{"kind", "lost"}, {"by", ""}, {"words", ""}};  // if the next line throws
    const auto decision = tree_.decision(name);
    json["decision"] = nullptr;
    if (decision) {
      json["decision"] = {{"kind", to_string(decision->kind)}, {"by", decision->by}, {"words", in_words(*decision)}};
      if (decision->forbids()) json["obstacle"] = "It was decided not to use the result.";
    }
    (void)registered_content(name, kReport);
  } catch (const Error& error) {
    json["obstacle"] = error.what();
  }
  return json;
}

// The engine says so; while it does not, nothing can be chosen.
bool Room::can_choose(const std::string& session) const {
  try {
    const auto engine = read_engine_state(tree_.path(), clock_.file_time());
    return engine && std::ranges::find(engine->state.chosen, name_of_xrays(session), &WaitingSession::name) !=
                         engine->state.chosen.end();
  } catch (const Error&) {
    return false;
  }
}

Json Room::trend(const std::string& session) {
  const std::lock_guard lock(mutex_);
  look();
  const ListedSession& listed = this->listed(session);
  std::vector<ListedSession> of_patient;
  std::ranges::copy_if(list_.sessions(), std::back_inserter(of_patient),
                       [&](const ListedSession& one) { return one.patient_key == listed.patient_key; });
  return json_of(trend_of(tree_, std::move(of_patient)));
}

std::string Room::registered_content(const std::string& session, const std::string& name) const {
  const SessionRecord record = tree_.registered(session);
  const auto file = record.files.find(name);
  if (file == record.files.end()) throw NotThere(fmt::format("session {}: has no file {}", session, name));
  std::string content = content_of(tree_.session(session) / name);
  if (sha256_of(content) != file->second)
    throw Error(fmt::format("session {}: {} was changed since its registration", session, name));
  return content;
}

std::string Room::file(const std::string& session, const std::string& name) {
  const std::lock_guard lock(mutex_);
  look();
  (void)listed(session);
  return registered_content(session, name);
}

void Room::release(const std::string& session, const ResultsTree::Seen& seen, const std::string& user,
                   bool despite_objection) {
  const std::lock_guard lock(mutex_);
  tree_.release(session,
                {.by = user, .user = user_.name, .sudo_user = user_.sudo_user, .despite_objection = despite_objection},
                watch_.names_of_peers(), seen);
  seen_.reset();
}

void Room::decide(const Decision& decision) {
  const std::lock_guard lock(mutex_);
  tree_.decide(decision);
  seen_.reset();
}

WaitingSession Room::waiting(const std::string& session) const {
  const std::optional<EngineSeen> engine = read_engine_state(tree_.path(), clock_.file_time());
  if (engine)
    for (const auto* sessions : {&engine->state.waiting, &engine->state.chosen})
      for (const WaitingSession& one : *sessions)
        if (one.name == name_of_xrays(session)) return one;
  throw NotThere(
      fmt::format("there is nothing to choose for session {}: it may have a result by now, or other X-rays "
                  "have come",
                  session));
}

Json Room::options(const std::string& session) {
  const std::lock_guard lock(mutex_);
  const WaitingSession waits = waiting(session);
  Json json = json_of(waits.options);
  json["patient"] = waits.patient_id;
  json["acquired"] = waits.acquired;
  json["state"] = waits.why;
  json["choice"] = "";
  try {
    if (const auto choice = tree_.choice(waits.name)) json["choice"] = in_words(*choice);
  } catch (const Error& error) {
    json["choice"] = error.what();
  }
  return json;
}

std::string Room::choose(const std::string& session, const ChosenIds& ids, const std::string& reason,
                         const std::string& user) {
  const std::lock_guard lock(mutex_);
  const WaitingSession waits = waiting(session);
  const auto views = static_cast<std::size_t>(watch_.site.sessions ? watch_.site.sessions->views : 1);
  if (ids.xrays.size() < views)
    throw Error(fmt::format("{} X-rays make a session here (sessions.views of the site file)", views));
  Choice choice = chosen_from(waits.options, ids);
  choice.patient_id = waits.patient_id;
  choice.reason = reason;
  choice.by = user;
  tree_.choose(choice);
  return choice.session;
}

void Room::withdraw_choice(const std::string& session, const std::string& reason, const std::string& user) {
  const std::lock_guard lock(mutex_);
  auto choice = tree_.choice(session);
  if (!choice || choice->is_withdrawn) throw Error(fmt::format("session {}: there is no choice to withdraw", session));
  choice->is_withdrawn = true;
  choice->reason = reason;
  choice->by = user;
  tree_.choose(*choice);
}

bool Room::is_there(const std::string& session) {
  (void)seen();
  const std::lock_guard lock(mutex_);
  return std::ranges::find(list_.sessions(), session, &ListedSession::name) != list_.sessions().end();
}

ManualBasis Room::manual_basis(const std::string& session) {
  const std::lock_guard lock(mutex_);
  look();
  (void)listed(session);
  return tree_.manual_basis(session);
}

Eigen::Isometry3d Room::setup_error(const std::string& session) {
  const std::lock_guard lock(mutex_);
  return read_report(tree_.session(tree_.newest_of_same_xrays(session))).setup_error;
}

std::filesystem::path Room::by_hand(const std::string& session) const {
  return watch_.results / "by_hand" / name_of_xrays(session);
}

std::string Room::hand_over(const ManualBasis& basis, const MadeResult& result, const std::string& user) {
  const std::lock_guard lock(mutex_);
  return tree_.hand_over(basis, result, user);
}

void Room::audit(const std::string& event, const std::string& user, const std::string& session) {
  const std::lock_guard lock(mutex_);
  Json details = {{"by", user}};
  if (!session.empty()) details["session"] = session;
  tree_.audit(event, details);
}

}  // namespace isoshift
