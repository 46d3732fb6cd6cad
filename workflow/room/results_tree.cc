#include "workflow/room/results_tree.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include "base/error.h"
#include "base/json_file.h"
#include "base/local_time.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/report/result_folder.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

fs::path release_file(const fs::path& tree, const std::string& session) {
  return tree / "released" / (session + ".json");
}

std::vector<Delivery> deliveries_of(const Release& release) {
  std::vector<Delivery> all;
  for (const std::string& peer : release.peers)
    for (const Release::Object& object : release.objects)
      all.push_back({.session = release.session, .peer = peer, .object = object});
  return all;
}

}  // namespace

ResultsTree::ResultsTree(fs::path path) : path_(std::move(path)) {
  for (const char* folder : {"sessions", "released", "sent"}) {
    std::error_code error;
    fs::create_directories(path_ / folder, error);
    if (error) throw Error(fmt::format("{}: cannot be made: {}", (path_ / folder).string(), error.message()));
  }
}

std::optional<FileLock> ResultsTree::try_lock() const { return FileLock::try_take(path_ / ".watch.lock"); }

bool ResultsTree::is_released(const std::string& session) const { return fs::exists(release_file(path_, session)); }

std::vector<std::string> ResultsTree::sessions() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(path_ / "sessions"))
    if (fs::exists(entry.path() / kResultFile) && entry.path().extension().empty())
      names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

void ResultsTree::clean() const {
  for (const auto& entry : fs::directory_iterator(path_ / "sessions"))
    if (entry.path().filename().string().find(".partial-") != std::string::npos) fs::remove_all(entry.path());
}

std::optional<Release> ResultsTree::release_of(const std::string& session) const {
  if (!is_released(session)) return std::nullopt;
  const nlohmann::json json = read_json_file(release_file(path_, session)).json;
  Release release{
      .session = session, .by = json.at("by"), .on = json.at("on"), .objects = {}, .peers = json.at("peers")};
  for (const auto& object : json.at("objects")) release.objects.push_back({object.at("file"), object.at("sha256")});
  return release;
}

Release ResultsTree::release(const std::string& session, const std::string& by,
                             const std::vector<std::string>& peers) const {
  const fs::path folder = this->session(session);
  if (session.find('/') != std::string::npos || !fs::exists(folder / kResultFile))
    throw Error(fmt::format("{}: holds no session {}", path_.string(), session));
  const std::string verdict = read_json_file(folder / kResultFile).json.at("verdict");
  if (verdict == "rejected") throw Error(fmt::format("session {}: was rejected: there is nothing to release", session));
  Release release{.session = session, .by = by, .on = local_time(), .objects = {}, .peers = peers};
  Json objects = Json::array();
  for (const char* file : {kRegistrationFile, "report.dcm"}) {
    if (!fs::exists(folder / file)) continue;
    release.objects.push_back({file, sha256_of_file(folder / file)});
    objects.push_back({{"file", file}, {"sha256", release.objects.back().sha256}});
  }
  // Of two who release at the same time one is told that the other has: a hard link does not replace.
  const fs::path file = release_file(path_, session),
                 aside = path_ / "released" / fmt::format(".{}.{}", session, ::getpid());
  replace_text(aside, Json{{"schema", 1},
                           {"session", session},
                           {"by", by},
                           {"on", release.on},
                           {"verdict", verdict},
                           {"objects", objects},
                           {"peers", peers}}
                              .dump(2) +
                          "\n");
  const int failed = ::link(aside.c_str(), file.c_str());
  const int reason = errno;
  std::error_code ignored;
  fs::remove(aside, ignored);
  if (failed != 0 && reason == EEXIST) {
    const Release before = release_of(session).value();
    throw Error(fmt::format("session {}: has been released by {} on {}", session, before.by, before.on));
  }
  if (failed != 0) throw Error(fmt::format("{}: cannot be written: {}", file.string(), std::strerror(reason)));
  flush(file.parent_path());
  audit("released", {{"session", session}, {"by", by}, {"verdict", verdict}, {"objects", objects}, {"peers", peers}});
  return release;
}

fs::path ResultsTree::sent_file(const Delivery& delivery) const {
  return path_ / "sent" / fmt::format("{}.{}.{}", delivery.session, delivery.peer, delivery.object.file);
}

std::vector<std::string> ResultsTree::released() const {
  std::vector<std::string> sessions;
  for (const auto& entry : fs::directory_iterator(path_ / "released"))
    if (entry.path().extension() == ".json" && !entry.path().filename().string().starts_with('.'))
      sessions.push_back(entry.path().stem().string());
  std::ranges::sort(sessions);
  return sessions;
}

std::vector<Delivery> ResultsTree::pending_of(const Release& release) const {
  std::vector<Delivery> pending = deliveries_of(release);
  std::erase_if(pending, [&](const Delivery& delivery) { return fs::exists(sent_file(delivery)); });
  return pending;
}

std::vector<Delivery> ResultsTree::pending() const {
  std::vector<Delivery> pending;
  for (const std::string& session : released()) {
    if (delivered_.contains(session)) continue;
    try {
      std::vector<Delivery> left = pending_of(release_of(session).value());
      if (left.empty()) delivered_.insert(session);
      std::ranges::move(left, std::back_inserter(pending));
    } catch (const std::exception&) {
      continue;  // whoever shows its state says that it cannot be read
    }
  }
  return pending;
}

fs::path ResultsTree::checked_file(const Delivery& delivery) const {
  fs::path file = session(delivery.session) / delivery.object.file;
  if (sha256_of_file(file) != delivery.object.sha256)
    throw Error(fmt::format("{}: is not what was released: its SHA-256 differs", file.string()));
  return file;
}

fs::path ResultsTree::prepared_file(const Delivery& delivery) const {
  return path_ / "sent" / ("." + sent_file(delivery).filename().string());
}

void ResultsTree::prepare_to_send(const Delivery& delivery) const {
  replace_text(prepared_file(delivery), Json{{"on", local_time()}, {"object", delivery.object.sha256}}.dump() + "\n");
}

bool ResultsTree::is_in_doubt(const Delivery& delivery) const { return fs::exists(prepared_file(delivery)); }

void ResultsTree::mark_sent(const Delivery& delivery, const std::string& answer) const {
  fs::rename(prepared_file(delivery), sent_file(delivery));
  flush(path_ / "sent");
  audit("sent", {{"session", delivery.session},
                 {"peer", delivery.peer},
                 {"object", delivery.object.sha256},
                 {"answer", answer.empty() ? "success" : answer}});
}

void ResultsTree::complete_audit() const {
  std::set<std::string> written;  // events, with what tells one from another
  const auto key = [](const Json& line) {
    return line.value("event", "") + " " + line.value("session", "") + " " + line.value("peer", "") + " " +
           line.value("object", "");
  };
  std::ifstream file(path_ / "audit.jsonl");
  for (std::string text; std::getline(file, text);)
    if (const Json line = Json::parse(text, nullptr, false); line.is_object()) written.insert(key(line));
  const auto complete = [&](const char* event, Json details) {
    Json line = {{"event", event}};
    line.update(details);
    if (written.contains(key(line))) return;
    details["noted"] = "at the next start";
    audit(event, details);
  };
  for (const std::string& session : sessions()) complete("registered", {{"session", session}});
  for (const std::string& session : released()) {
    const Release release = release_of(session).value();
    complete("released", {{"session", session}, {"by", release.by}, {"released_on", release.on}});
    for (const Delivery& delivery : deliveries_of(release))
      if (fs::exists(sent_file(delivery)))
        complete("sent", {{"session", session}, {"peer", delivery.peer}, {"object", delivery.object.sha256}});
  }
}

void ResultsTree::audit(const std::string& event, const Json& details) const {
  Json line = {{"on", local_time()}, {"event", event}};
  line.update(details);
  unwritten_ += line.dump() + "\n";
  const int descriptor = ::open((path_ / "audit.jsonl").c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0640);
  if (descriptor < 0) return;
  ::flock(descriptor, LOCK_EX);
  const off_t before = ::lseek(descriptor, 0, SEEK_END);
  char last = '\n';
  if (before > 0 && ::pread(descriptor, &last, 1, before - 1) == 1 && last != '\n') unwritten_.insert(0, "\n");
  const ssize_t written = ::write(descriptor, unwritten_.data(), unwritten_.size());
  if (written == static_cast<ssize_t>(unwritten_.size()) && ::fsync(descriptor) == 0)
    unwritten_.clear();
  else if (written > 0 && ::ftruncate(descriptor, before) != 0)
    unwritten_.erase(0, static_cast<std::size_t>(written));
  ::close(descriptor);
}

}  // namespace isoshift
