#include "workflow/room/results_tree.h"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <thread>

#include "base/error.h"
#include "base/json_file.h"
#include "base/local_time.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "base/system_user.h"
#include "io/report/result_folder.h"
#include "workflow/room/audit_to_syslog.h"
#include "workflow/room/signed_json.h"
#include "workflow/room/statement_files.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kAgain =
    "Nothing of the session is sent. To have its X-rays registered again, move the session's folder away and restart "
    "isoshift room watch";

// What a statement says, read by `from`.
template <class From>
auto as_stated(const nlohmann::json& statement, const std::string& session, From&& from) {
  try {
    return from(statement);
  } catch (const std::exception& error) {
    throw Error(fmt::format("session {}: what a person has said about it is of another version of isoshift: {}",
                            session, error.what()));
  }
}

constexpr const char* kObjectionsFile = "objections.json";

Json json_of(const Objection& objection) {
  return {{"words", objection.words}, {"newer_have_results", objection.newer_have_results}};
}

// Of its text in the file.
std::string sha256_of(const Objection& objection) { return isoshift::sha256_of(file_text(json_of(objection))); }

// The results of the session's X-rays, the oldest first. The first may have been moved away by hand.
std::vector<std::string> of_same_xrays(const fs::path& results, const std::string& session) {
  std::vector<std::string> names;
  for (int number = 1;; ++number) {
    std::string name = name_of_xrays(session, number);
    const bool is_there = fs::exists(results / "sessions" / name);
    if (is_there) names.push_back(std::move(name));
    if (!is_there && number > 1) return names;
  }
}

// Folders of registrations under way: ".NAME.registering-PROCESS", and what isoshift register writes beside them.
constexpr const char* kRegistering = ".registering-";

}  // namespace

void check_is_owner(const fs::path& results) {
  struct stat of_results{};
  if (::stat(results.c_str(), &of_results) == 0 && of_results.st_uid != ::geteuid())
    throw Error(
        fmt::format("{}: belongs to another user, who runs isoshift room watch: run this command as that user "
                    "(sudo -u USER)",
                    results.string()));
}

ResultsTree::ResultsTree(fs::path path)
    : path_(std::move(path)), audit_(path_ / "audit.jsonl"), marks_(path_ / "sent") {
  for (const char* folder : {"sessions", "registered", "released", "sent", "decided", "chosen", "orders", "inputs",
                             "handed_over", "deleted"}) {
    std::error_code error;
    fs::create_directories(path_ / folder, error);
    if (error) throw Error(fmt::format("{}: cannot be made: {}", (path_ / folder).string(), error.message()));
  }
}

ResultsTree::ResultsTree(const WatchFile& watch) : ResultsTree(watch.results) {
  if (!watch.signing_key.empty()) key_.emplace(watch.signing_key);
  needs_second_person_ = watch.needs_second_person;
  if (watch.syslog) audit_.set_mirror(audit_to_syslog(watch));
}

std::optional<FileLock> ResultsTree::try_lock() const { return FileLock::try_take(path_ / ".watch.lock"); }

fs::path ResultsTree::record_file(const std::string& session) const {
  return path_ / "registered" / (session + ".json");
}

fs::path ResultsTree::order_file(const std::string& session) const { return path_ / "orders" / (session + ".json"); }

fs::path ResultsTree::inputs_file(const std::string& session) const { return path_ / "inputs" / (session + ".json"); }

fs::path ResultsTree::handed_over_folder(const std::string& session) const {
  return path_ / "handed_over" / name_of_xrays(session);
}

fs::path ResultsTree::release_file(const std::string& session) const {
  return path_ / "released" / (session + ".json");
}

std::map<std::string, Objection> ResultsTree::objections() const {
  const fs::path file = path_ / kObjectionsFile;
  std::map<std::string, Objection> all;
  if (!fs::exists(file)) return all;
  try {
    for (const auto& [session, objection] : read_json_file(file).json.get<std::map<std::string, nlohmann::json>>())
      all[session] = {.words = objection.at("words"), .newer_have_results = objection.at("newer_have_results")};
  } catch (const nlohmann::json::exception&) {
    throw Error(fmt::format("{}: is not a list of objections as isoshift room watch writes it", file.string()));
  }
  return all;
}

void ResultsTree::keep_objections(const std::map<std::string, Objection>& objections) {
  Json json = Json::object();
  for (const auto& [session, objection] : objections) {
    json[session] = json_of(objection);
    if (const std::string sha256 = sha256_of(objection); audit_.newest_objection(session) != sha256)
      audit_.append("objection", {{"session", session}, {"objection", sha256}});
  }
  replace_text(path_ / kObjectionsFile, file_text(json));
}

Objection ResultsTree::objection(const std::string& session) const {
  const std::map<std::string, Objection> all = objections();
  const auto found = all.find(session);
  Objection objection = found == all.end() ? Objection() : found->second;
  const std::string proven = audit_.newest_objection(session);
  if (proven.empty() || proven == sha256_of(objection)) return objection;
  return {.words = fmt::format("audit.jsonl tells of an objection to it that {} does not hold{}{}", kObjectionsFile,
                               objection.words.empty() ? "" : "; ", objection.words)};
}

bool ResultsTree::is_released(const std::string& session) const { return fs::exists(release_file(session)); }

std::vector<std::string> ResultsTree::sessions() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(path_ / "sessions"))
    if (fs::exists(entry.path() / kResultFile) && entry.path().extension().empty())
      names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

void ResultsTree::clean() {
  for (const auto& entry : fs::directory_iterator(path_ / "sessions"))
    if (entry.path().filename().string().find(kRegistering) != std::string::npos) fs::remove_all(entry.path());
}

fs::path ResultsTree::registering(const std::string& session) const {
  return path_ / "sessions" / fmt::format(".{}{}{}", session, kRegistering, ::getpid());
}

void ResultsTree::check_is_new(const std::string& session) const {
  const fs::path folder = this->session(session);
  if (fs::exists(fs::symlink_status(folder)))
    throw Error(
        fmt::format("{}: exists already, and holds no readable result of these X-rays. Move it away; then the X-rays "
                    "are registered again",
                    folder.string()));
}

void ResultsTree::publish(const std::string& session, const FileHashes& made) {
  publish(session, {.folder = registering(session), .files = made}, "");
}

void ResultsTree::publish(const std::string& session, const MadeResult& result, const std::string& handed_over) {
  check_is_new(session);
  check_is_not_deleted(session);
  const SessionRecord record = record_of(session, result.folder, result.files);
  const std::string text = json_of(record);
  replace_text(record_file(session), text);
  Json line = {{"session", session}, {"verdict", record.verdict}, {"record", sha256_of(text)}};
  if (!handed_over.empty()) line["handed_over"] = handed_over;
  audit_.append("registered", line);
  if (::rename(result.folder.c_str(), this->session(session).c_str()) != 0)
    throw WriteError(fmt::format("{}: cannot be written: {}", this->session(session).string(), std::strerror(errno)));
  flush(path_ / "sessions");
}

void ResultsTree::keep_order(const std::string& session, const RegistrationOrder& order) {
  replace_text(order_file(name_of_xrays(session)), to_line(order) + "\n");
}

void ResultsTree::keep_inputs(const std::string& session, const SessionInputs& inputs) {
  replace_text(inputs_file(session), file_text(json_of(inputs)));
}

std::optional<SessionInputs> ResultsTree::inputs(const std::string& session) const {
  std::optional<SessionInputs> newest;
  for (const std::string& name : of_same_xrays(path_, session)) {
    const fs::path file = inputs_file(name);
    if (!fs::exists(file)) continue;
    try {
      newest = session_inputs_from(read_json_file(file).json);
    } catch (const nlohmann::json::exception& error) {
      throw Error(
          fmt::format("{}: does not tell from what session {} was registered: {}", file.string(), name, error.what()));
    }
  }
  return newest;
}

RegistrationOrder ResultsTree::order(const std::string& session) const {
  const fs::path file = order_file(name_of_xrays(session));
  std::ifstream text(file);
  std::string line;
  if (!std::getline(text, line))
    throw Error(
        fmt::format("session {}: how it was registered is not known: {} cannot be read. An earlier version of "
                    "isoshift room watch registered it",
                    session, file.string()));
  return registration_order_from(line, file.string());
}

ManualBasis ResultsTree::manual_basis(const std::string& session) const {
  return {.newest = newest_of_same_xrays(session), .order = order(session), .inputs = inputs(session)};
}

// First the line in the audit log, then the statement, then the folder, which counts.
std::string ResultsTree::hand_over(const ManualBasis& basis, const MadeResult& result, const std::string& by) {
  const FileLock lock = lock_releases();
  const std::string& session = basis.newest;
  check_is_not_deleted(session);
  if (manual_basis(session) != basis)
    throw Error(
        fmt::format("session {}: its X-rays have another result or are registered in another way since this result "
                    "was begun by hand. Load the page again, and register again",
                    session));
  const fs::path place = handed_over_folder(session);
  if (fs::exists(place))
    throw Error(
        fmt::format("session {}: an earlier result by hand waits for isoshift room watch. Try again when it has been "
                    "taken over",
                    session));
  const SessionRecord record = record_of(further_name(session), result.folder, result.files);
  const std::string xrays = name_of_xrays(session), user = system_user().name;
  Json statement = {{"schema", 1}, {"session", xrays}, {"by", by}, {"user", user}, {"on", local_time()}};
  statement["files"] = result.files;
  statement["inputs"] = basis.inputs ? json_of(*basis.inputs) : Json(nullptr);
  put_statement(kHandOverStatement, path_, xrays, std::move(statement),
                {{"session", xrays}, {"by", by}, {"user", user}, {"verdict", record.verdict}}, audit_, key_);
  fs::rename(result.folder, place);
  flush(path_ / "handed_over");
  return record.session;
}

std::vector<std::string> ResultsTree::handed_over() const {
  std::vector<std::string> sessions;
  for (const auto& entry : fs::directory_iterator(path_ / "handed_over"))
    if (fs::exists(entry.path() / kResultFile)) sessions.push_back(entry.path().filename().string());
  return sessions;
}

bool ResultsTree::is_handed_over(const std::string& session) const { return fs::exists(handed_over_folder(session)); }

std::string ResultsTree::take_over(const std::string& session) {
  std::string name = further_name(session);
  const std::string xrays = name_of_xrays(session);
  MadeResult result{.folder = handed_over_folder(session), .files = {}};
  const auto refuse = [&](const std::string& why) {
    return Error(fmt::format("{}: {}. {}", result.folder.string(), why, kHandOverStatement.consequence));
  };
  const auto statement = newest_statement(kHandOverStatement, path_, xrays, audit_, key_);
  if (!statement) throw refuse("nobody has handed it over on the screen of isoshift room serve");
  const std::string proof = audit_.newest_statement(kHandOverStatement.event, xrays);
  if (const std::string made = audit_.made_of_hand_over(proof); !made.empty() && fs::exists(this->session(made)))
    throw refuse(fmt::format("what was handed over last is session {} already", made));
  try {
    result.files = statement->at("files").get<FileHashes>();
    if (const nlohmann::json& inputs = statement->at("inputs"); !inputs.is_null())
      keep_inputs(name, session_inputs_from(inputs));
  } catch (const nlohmann::json::exception& error) {
    throw refuse(fmt::format("who has handed it over is of another version of isoshift: {}", error.what()));
  }
  try {
    (void)record_of(name, result.folder, result.files);
  } catch (const Error& error) {
    throw refuse(error.what());
  }
  publish(name, result, proof);
  return name;
}

std::string ResultsTree::further_name(const std::string& session) const {
  int number = 2;
  while (fs::exists(fs::symlink_status(this->session(name_of_xrays(session, number))))) ++number;
  return name_of_xrays(session, number);
}

std::string ResultsTree::newest_of_same_xrays(const std::string& session) const {
  const std::vector<std::string> all = of_same_xrays(path_, session);
  return all.empty() ? session : all.back();
}

SessionRecord ResultsTree::registered(const std::string& session) const {
  const fs::path file = record_file(session);
  if (!fs::exists(file))
    throw Error(
        fmt::format("session {}: there is no record of its registration ({}). {}", session, file.string(), kAgain));
  SessionRecord record = read_session_record(file);
  if (!audit_.has_registration(session, record.sha256))
    throw Error(fmt::format("{}: is not the record of the newest registration of session {} in audit.jsonl. {}",
                            file.string(), session, kAgain));
  return record;
}

std::optional<fs::file_time_type> ResultsTree::registered_at(const std::string& session) const {
  std::error_code missing;
  const fs::file_time_type at = fs::last_write_time(record_file(session), missing);
  return missing ? std::nullopt : std::optional(at);
}

SessionRecord ResultsTree::checked(const std::string& session) const {
  SessionRecord record = registered(session);
  try {
    check_unchanged(record, this->session(session));
  } catch (const Error& error) {
    throw Error(fmt::format("{}. {}", error.what(), kAgain));
  }
  return record;
}

std::optional<Release> ResultsTree::release_of(const std::string& session) const {
  if (!is_released(session)) return std::nullopt;
  const fs::path path = release_file(session);
  const JsonFile file = read_json_file(path);
  if (!audit_.has_release(session, file.sha256))
    throw Error(fmt::format(
        "{}: is not the newest release of session {} in audit.jsonl: isoshift room release did not write this "
        "file, or it was changed since, or another release followed it. Nothing of the session is sent. "
        "Remove the file, and release the session with isoshift room release",
        path.string(), session));
  if (!is_signed(file.json, key_))
    throw Error(fmt::format(
        "{}: is not signed by the signing_key of the watch file. Nothing of the session is sent. Remove the "
        "file, and release the session with isoshift room release",
        path.string()));
  Release release;
  try {
    release = release_from(file.json);
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: is not a release: {}", path.string(), error.what()));
  }
  if (release.record != registered(session).sha256)
    throw Error(
        fmt::format("{}: releases an earlier registration of the session. Nothing of the session is sent. "
                    "Remove the file, and release the session with isoshift room release",
                    path.string()));
  return release;
}

void ResultsTree::decide(Decision decision) {
  const FileLock lock = lock_releases();
  if (!std::ranges::binary_search(sessions(), decision.session))
    throw Error(fmt::format("{}: holds no session {}", path_.string(), decision.session));
  if (registered(decision.session).sha256 != decision.record)
    throw Error(fmt::format("session {}: is not what was on the screen any more. Look at it again", decision.session));
  if (decision.kind == DecisionKind::kReopened && !is_decided(decision.session))
    throw Error(fmt::format("session {}: there is no decision to take back", decision.session));
  if (decision.kind == DecisionKind::kAgreed)
    if (const auto before = this->decision(decision.session); before && before->forbids())
      throw Error(fmt::format("session {}: {}. Take that back first", decision.session, in_words(*before)));
  decision.user = system_user().name;
  decision.on = local_time();
  put_statement(kDecisionStatement, path_, decision.session, json_of(decision),
                {{"session", decision.session},
                 {"decision", to_string(decision.kind)},
                 {"by", decision.by},
                 {"user", decision.user},
                 {"record", decision.record}},
                audit_, key_);
}

// Also if the decision was lost.
bool ResultsTree::is_decided(const std::string& session) const {
  try {
    return decision(session).has_value();
  } catch (const Error&) {
    return true;
  }
}

std::optional<Decision> ResultsTree::decision(const std::string& session) const {
  const auto statement = newest_statement(kDecisionStatement, path_, session, audit_, key_);
  if (!statement) return std::nullopt;
  Decision decision = as_stated(*statement, session, decision_from);
  const bool stands = decision.kind != DecisionKind::kReopened && decision.record == registered(session).sha256;
  return stands ? std::optional(std::move(decision)) : std::nullopt;
}

void ResultsTree::choose(Choice choice) {
  const FileLock lock = lock_releases();
  choice.user = system_user().name;
  choice.on = local_time();
  put_statement(kChoiceStatement, path_, choice.session, json_of(choice),
                {{"session", choice.session}, {"by", choice.by}, {"user", choice.user}}, audit_, key_);
}

std::optional<Choice> ResultsTree::choice(const std::string& session) const {
  const std::string xrays = name_of_xrays(session);
  const auto statement = newest_statement(kChoiceStatement, path_, xrays, audit_, key_);
  return statement ? std::optional(as_stated(*statement, xrays, choice_from)) : std::nullopt;
}

std::map<std::string, std::string> ResultsTree::chosen() const {
  std::map<std::string, std::string> choices;
  for (const std::string& session : audit_.sessions_with(kChoiceStatement.event))
    if (!is_deleted(path_, session)) choices[session] = "";  // its files may be gone
  std::set<fs::path> files;
  for (const auto& entry : fs::directory_iterator(path_ / kChoiceStatement.folder)) files.insert(entry.path());
  for (const fs::path& file : files) {
    const std::string name = file.filename().string();
    std::error_code gone;
    const auto written = fs::last_write_time(file, gone);
    if (!name.starts_with('.'))
      choices[name.substr(0, name.find('.'))] += fmt::format("{} {}\n", name, written.time_since_epoch().count());
  }
  return choices;
}

void ResultsTree::check_stands(const std::string& session) const {
  if (const std::string newest = newest_of_same_xrays(session); newest != session)
    throw Error(fmt::format("session {}: its X-rays have a newer result, session {}", session, newest));
  if (is_handed_over(session))
    throw Error(fmt::format(
        "session {}: its X-rays have a newer result by hand, which isoshift room watch has yet to take over ({})",
        session, handed_over_folder(session).string()));
  if (const auto decided = decision(session); decided && decided->forbids())
    throw Error(fmt::format("session {}: {}. Take that back first, on the screen of isoshift room serve", session,
                            in_words(*decided)));
  check_inputs(session);
}

// The files from which the X-rays were registered last, as they are on the disk now: isoshift room watch looks at files
// only when no more of them come. What an earlier version of isoshift has registered is not compared.
void ResultsTree::check_inputs(const std::string& session) const {
  const std::optional<SessionInputs> before = inputs(session);
  if (!before || !fs::exists(order_file(name_of_xrays(session)))) return;
  if (const std::string parts = what_changed(*before, order(session).parts, FileContents()); !parts.empty())
    throw Error(
        fmt::format("session {}: {} changed after the registration. isoshift room watch registers its X-rays again",
                    session, parts));
}

fs::path ResultsTree::missing_input(const std::string& session) const {
  if (!fs::exists(order_file(name_of_xrays(session)))) return {};
  for (const std::vector<fs::path>& files : files_of(order(session).parts))
    for (const fs::path& file : files)
      if (!fs::exists(file)) return file;
  return {};
}

void ResultsTree::check_second_person(const SessionRecord& record, const std::string& releaser) const {
  const auto decided = decision(record.session);
  const std::string agreed = decided && decided->kind == DecisionKind::kAgreed ? decided->by : "";
  if (!record.pose_set_by.empty() && releaser == record.pose_set_by && (agreed.empty() || agreed == releaser))
    throw Error(fmt::format("session {}: {} has set its pose by hand: another person must agree first, or release it",
                            record.session, releaser));
  if (needs_second_person_ && record.verdict != "accepted" && (agreed.empty() || agreed == releaser))
    throw Error(
        fmt::format("session {}: its verdict is {}: the watch file asks for a second person, who must agree "
                    "first",
                    record.session, record.verdict));
}

void ResultsTree::check_is_not_deleted(const std::string& session) const {
  if (is_deleted(path_, session)) throw Error(fmt::format("session {}: was deleted", session));
}

// Nothing of a damaged session is sent.
bool ResultsTree::is_to_be_sent(const std::string& session) const {
  try {
    const auto release = release_of(session);
    if (!release || pending_of(*release).empty()) return false;
    check_stands(session);
    return true;
  } catch (const Error&) {
    return false;
  }
}

// First the line in the audit log, then the file, then the results: finish_deletions() continues after the second.
void ResultsTree::remove(const std::string& session, const std::string& by) {
  const FileLock lock = lock_releases();
  if (!std::ranges::binary_search(sessions(), session) && !chosen().contains(name_of_xrays(session)))
    throw Error(fmt::format("{}: holds no session {}", path_.string(), session));
  Deletion deletion{
      .session = name_of_xrays(session), .by = by, .user = system_user().name, .on = local_time(), .xrays = {}};
  // A damaged result or choice names no X-rays.
  const auto add_unless_damaged = [&](const auto& read_uids) {
    try {
      for (const std::string& uid : read_uids()) deletion.xrays.insert(isoshift::sha256_of(uid));
    } catch (const Error&) {
      return;
    }
  };
  for (const std::string& name : of_same_xrays(path_, session)) {
    if (is_to_be_sent(name))
      throw Error(
          fmt::format("session {}: was released and is still to be sent. Wait until it is sent, or reject it on the "
                      "screen of isoshift room serve",
                      name));
    add_unless_damaged([&] { return xrays_of(this->session(name)); });
  }
  add_unless_damaged([&] {
    std::set<std::string> uids;
    if (const auto chosen = choice(session))
      for (const Candidate& xray : chosen->xrays) uids.insert(xray.id);
    return uids;
  });
  audit_.append("deleted", {{"session", deletion.session}, {"by", by}, {"user", deletion.user}});
  put_deletion(path_, deletion);
  remove_deleted(path_, {deletion});
}

std::vector<Deletion> ResultsTree::finish_deletions() const {
  std::vector<Deletion> all = deletions(path_);
  remove_deleted(path_, all);
  return all;
}

fs::file_time_type ResultsTree::newest_deletion() const { return fs::last_write_time(path_ / "deleted"); }

// Only one process releases at a time.
FileLock ResultsTree::lock_releases() const {
  constexpr std::chrono::seconds kPatience(5);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  for (;;) {
    if (auto lock = FileLock::try_take(path_ / ".release.lock")) return *std::move(lock);
    if (std::chrono::steady_clock::now() > end)
      throw Error(fmt::format("{}: another release is under way. Try again", path_.string()));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

void ResultsTree::check_objects_are_new(const Release& release) const {
  for (const Release::Object& object : release.objects)
    if (const auto other = audit_.session_releasing(object.sha256); other && *other != release.session)
      throw Error(fmt::format("session {}: its {} has already been released with session {}", release.session,
                              object.file, *other));
}

Release ResultsTree::release(const std::string& session, const Releaser& releaser,
                             const std::vector<std::string>& peers, const std::optional<Seen>& seen) {
  if (!std::ranges::binary_search(sessions(), session))
    throw Error(fmt::format("{}: holds no session {}", path_.string(), session));
  const FileLock lock = lock_releases();
  if (const auto before = release_of(session))
    throw Error(
        fmt::format("session {}: has been released by {} on {}", session, to_string(before->releaser), before->on));
  const SessionRecord record = checked(session);
  if (record.verdict == "rejected")
    throw Error(fmt::format("session {}: was rejected: there is nothing to release", session));
  check_stands(session);
  check_second_person(record, releaser.by);
  const bool is_again = audit_.has_been_released(session);
  if (!releaser.is_person && record.verdict != "accepted")
    throw Error(fmt::format("session {}: its verdict is {}: only a person can release it", session, record.verdict));
  if (!releaser.is_person && is_again)
    throw Error(
        fmt::format("session {}: was released before, as audit.jsonl says, and {} is gone: only a person can release "
                    "it again",
                    session, release_file(session).string()));
  const Objection other_xrays = objection(session);
  if (seen && (seen->record != record.sha256 || seen->objection != other_xrays.words))
    throw Error(fmt::format("session {}: is not what was on the screen any more. Look at it again", session));
  const bool is_allowed =
      other_xrays.words.empty() || releaser.despite_objection || (releaser.is_person && other_xrays.newer_have_results);
  if (!is_allowed)
    throw Error(
        fmt::format("session {}: {}.\n       To release its result all the same, repeat the command with "
                    "--despite-other-xrays",
                    session, other_xrays.words));
  Release release{.session = session,
                  .releaser = releaser,
                  .on = local_time(),
                  .verdict = record.verdict,
                  .record = record.sha256,
                  .despite = other_xrays.words,
                  .is_again = is_again,
                  .objects = {},
                  .peers = peers};
  for (const char* file : {kRegistrationFile, "report.dcm"})
    if (const auto found = record.files.find(file); found != record.files.end())
      release.objects.push_back({file, found->second});
  check_objects_are_new(release);
  put_release(release);
  return release;
}

// First the line in the audit log, then the file. Between the two there is a line and no release: the file of the next
// attempt has a line of its own.
void ResultsTree::put_release(const Release& release) {
  const fs::path file = release_file(release.session),
                 aside = path_ / "released" / fmt::format(".{}.json", release.session);
  Json json = {{"schema", 1}, {"on", release.on}};
  json.update(json_of(release));
  if (!release.despite.empty()) json["despite"] = release.despite;
  json[kAuditHeadKey] = audit_.head();
  sign(json, key_);
  const std::string text = file_text(json);
  replace_text(aside, text);
  std::error_code ignored;
  Json line = json_of(release);
  line["release"] = sha256_of(text);
  if (!release.despite.empty()) line["despite_other_xrays"] = true;  // in words it may name a patient's file
  if (release.is_again) line["again"] = true;
  try {
    audit_.append("released", line);
  } catch (const Error& error) {
    fs::remove(aside, ignored);
    throw Error(fmt::format("session {}: is not released: {}", release.session, error.what()));
  }
  const int failed = ::link(aside.c_str(), file.c_str());  // does not replace
  const int reason = errno;
  fs::remove(aside, ignored);
  if (failed != 0) {
    audit_.note("not released", {{"session", release.session}, {"release", line["release"]}});
    throw Error(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(reason)));
  }
  flush(file.parent_path());
}

std::set<std::string> ResultsTree::released() const {
  std::set<std::string> sessions;
  for (const auto& entry : fs::directory_iterator(path_ / "released"))
    if (entry.path().extension() == ".json" && !entry.path().filename().string().starts_with('.'))
      sessions.insert(entry.path().stem().string());
  return sessions;
}

bool ResultsTree::has_line(const Delivery& delivery) const {
  return audit_.has_sending(delivery.session, delivery.peer, delivery.object.sha256);
}

std::vector<Delivery> ResultsTree::pending_of(const Release& release) const {
  std::vector<Delivery> pending = deliveries_of(release);
  std::erase_if(pending, [&](const Delivery& delivery) { return marks_.has(delivery) && has_line(delivery); });
  return pending;
}

ResultsTree::Pending ResultsTree::pending() {
  Pending pending;
  std::map<std::size_t, std::vector<Delivery>> by_release;
  for (const std::string& session : released()) {
    if (delivered_.contains(session)) continue;
    try {
      const auto release = release_of(session);
      if (!release) continue;  // removed since
      std::vector<Delivery> left = pending_of(*release);
      if (left.empty()) delivered_.insert(session);
      by_release[audit_.release_number(session)] = std::move(left);
    } catch (const std::exception& error) {
      pending.refused[session] = error.what();
    }
  }
  for (auto& [number, left] : by_release) std::ranges::move(left, std::back_inserter(pending.deliveries));
  return pending;
}

fs::path ResultsTree::checked_file(const Delivery& delivery) const {
  const auto release = release_of(delivery.session);
  if (!release) throw Error(fmt::format("session {}: is not released any more", delivery.session));
  check_stands(delivery.session);
  const Objection other_xrays = objection(delivery.session);
  if (!other_xrays.words.empty() && other_xrays.words != release->despite)
    throw Error(fmt::format(
        "session {}: since its release, {}. To send it all the same, remove {} and release the session again "
        "with --despite-other-xrays",
        delivery.session, other_xrays.words, release_file(delivery.session).string()));
  const SessionRecord record = checked(delivery.session);
  const auto registered = record.files.find(delivery.object.file);
  fs::path file = session(delivery.session) / delivery.object.file;
  if (registered == record.files.end() || registered->second != delivery.object.sha256)
    throw Error(fmt::format("{}: is not what was released: its SHA-256 differs", file.string()));
  return file;
}

void ResultsTree::prepare_to_send(const Delivery& delivery) { marks_.prepare(delivery); }

bool ResultsTree::is_in_doubt(const Delivery& delivery) const {
  return marks_.is_prepared(delivery) || marks_.has(delivery) != has_line(delivery);
}

void ResultsTree::mark_sent(const Delivery& delivery, const std::string& answer) {
  marks_.put(delivery);
  audit("sent", {{"session", delivery.session},
                 {"peer", delivery.peer},
                 {"object", delivery.object.sha256},
                 {"answer", answer.empty() ? "success" : answer}});
}

void ResultsTree::audit(const std::string& event, const Json& details) { audit_.note(event, details); }

void ResultsTree::check_audit() const { (void)audit_.head(); }

void ResultsTree::write_kept_audit() { audit_.write_kept(); }

}  // namespace isoshift
