#include "workflow/room/audit_log.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string_view>
#include <thread>

#include "base/error.h"
#include "base/local_time.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "workflow/room/audit_chain.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

Json line_of(const std::string& event, const Json& details) {
  Json line = {{"on", local_time()}, {"event", event}};
  line.update(details);
  return line;
}

// What the first line to come covers with its link, of a log of so many bytes.
std::string end_of_log(int descriptor, off_t size) {
  constexpr off_t kFirst = 4096, kGrowth = 8;
  for (off_t length = kFirst;; length *= kGrowth) {
    std::string text(static_cast<std::size_t>(std::min(size, length)), '\0');
    if (::pread(descriptor, text.data(), text.size(), size - static_cast<off_t>(text.size())) < 0) return "";
    if (static_cast<off_t>(text.size()) == size) return std::string(unlinked_end(text));
    const std::size_t whole = text.find('\n') + 1;  // where the first whole line begins, if there is one
    const std::string_view lines = std::string_view(text).substr(whole), end = unlinked_end(lines);
    if (whole > 0 && end.size() < lines.size()) return std::string(end);
  }
}

bool has(const std::map<std::string, std::string>& entries, const std::string& key, const std::string& value) {
  const auto found = entries.find(key);
  return found != entries.end() && found->second == value;
}

// 0, or the errno of what failed: then all of it may be missing.
int append_and_flush(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return ::fsync(descriptor) == 0 ? 0 : errno;
}

}  // namespace

void AuditLog::lock(int descriptor) const {
  constexpr std::chrono::seconds kPatience(5);
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (std::chrono::steady_clock::now() > end)
      throw Error(fmt::format("{}: another program has locked it", path_.string()));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

void AuditLog::append(const std::string& event, const Json& details) {
  std::vector<Json> lines = kept_;
  lines.push_back(line_of(event, details));
  write(lines);
  kept_.clear();
}

void AuditLog::note(const std::string& event, const Json& details) {
  kept_.push_back(line_of(event, details));
  try {
    write_kept();
  } catch (const Error&) {
    return;  // kept; whoever calls write_kept() next says why
  }
}

void AuditLog::write_kept() {
  if (kept_.empty()) return;
  write(kept_);
  kept_.clear();
}

void AuditLog::write(const std::vector<Json>& lines) const {
  const int descriptor = ::open(path_.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0640);
  if (descriptor < 0) throw Error(fmt::format("{}: cannot be written: {}", path_.string(), std::strerror(errno)));
  const std::unique_ptr<const int, void (*)(const int*)> closed_at_the_end(&descriptor,
                                                                           [](const int* file) { ::close(*file); });
  lock(descriptor);
  const off_t before = ::lseek(descriptor, 0, SEEK_END);
  char last = '\n';  // a line that was cut off gets an end
  const bool is_cut = before > 0 && ::pread(descriptor, &last, 1, before - 1) == 1 && last != '\n';
  std::string covered = end_of_log(descriptor, before) + (is_cut ? "\n" : ""), text = is_cut ? "\n" : "";
  for (Json line : lines) {
    link(line, covered);
    covered = line.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
    text += covered;
  }
  const int failure = append_and_flush(descriptor, text);
  // What was written of a line is taken back. In a log that can only grow it stays, and the next line begins after it.
  [[maybe_unused]] const int undone = failure != 0 ? ::ftruncate(descriptor, before) : 0;
  if (failure != 0) throw Error(fmt::format("{}: cannot be written: {}", path_.string(), std::strerror(failure)));
  if (before == 0) flush(path_.parent_path());
  if (mirror_) std::ranges::for_each(lines, mirror_);
}

void AuditLog::Proofs::add_lines(std::string_view lines) {
  while (!lines.empty()) {
    const std::string_view line = lines.substr(0, lines.find('\n'));
    add(Json::parse(line, nullptr, false));
    lines.remove_prefix(std::min(line.size() + 1, lines.size()));
  }
}

// A line that was cut off proves nothing.
void AuditLog::Proofs::add(const Json& line) {
  if (!line.is_object()) return;
  const std::string event = text_in(line, "event"), session = text_in(line, "session");
  if (event == "registered") registrations[session] = text_in(line, "record");
  if (event == "registered" && line.contains("handed_over")) taken_over[text_in(line, "handed_over")] = session;
  if (event == "sent") sendings.insert({session, text_in(line, "peer"), text_in(line, "object")});
  if (event == "objection") objections[session] = text_in(line, "objection");
  if (std::ranges::find(kStatements, event) != kStatements.end()) statements[{event, session}] = text_in(line, "file");
  if (event == "not released") releases.erase(session);
  if (event != "released") return;
  releases[session] = text_in(line, "release");
  release_numbers[session] = ++releases_so_far;
  if (line.contains("objects") && line["objects"].is_array())
    for (const Json& object : line["objects"])
      if (object.is_object()) objects.emplace(text_in(object, "sha256"), session);
}

void AuditLog::refuse_another_log() const {
  throw Error(
      fmt::format("{}: is gone, was cut, or is another file than before. Nothing is released or sent until "
                  "isoshift room watch and isoshift room serve are started again, by a person who knows why",
                  path_.string()));
}

const AuditLog::Proofs& AuditLog::proofs() const {
  struct stat status{};
  if (::stat(path_.c_str(), &status) != 0) {
    if (errno != ENOENT) throw Error(fmt::format("{}: cannot be read: {}", path_.string(), std::strerror(errno)));
    if (!read_lines_.empty()) refuse_another_log();
    return proofs_;
  }
  const bool is_same = status.st_ino == read_version_.inode && status.st_size == read_version_.size &&
                       status.st_mtim.tv_sec == read_version_.written.tv_sec &&
                       status.st_mtim.tv_nsec == read_version_.written.tv_nsec;
  if (is_same) return proofs_;
  if (!S_ISREG(status.st_mode)) throw Error(fmt::format("{}: cannot be read: it is not a plain file", path_.string()));
  std::ifstream file(path_, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw Error(fmt::format("{}: cannot be read", path_.string()));
  if (!text.starts_with(read_lines_)) refuse_another_log();
  // Without a line that is being written, or was cut off.
  const std::string_view added = std::string_view(text).substr(0, text.rfind('\n') + 1).substr(read_lines_.size());
  cut_off_ = text.substr(read_lines_.size() + added.size());
  extend(chain_, added);
  proofs_.add_lines(added);
  read_lines_ += added;
  if (!chain_.broken.empty())
    throw Error(fmt::format(
        "{}: line {} does not follow from those before it: lines were changed, taken out or put in. Nothing "
        "is released or sent until a person has looked (isoshift room audit) and has recorded that",
        path_.string(), chain_.broken.front()));
  read_version_ = {.inode = status.st_ino, .size = status.st_size, .written = status.st_mtim};
  return proofs_;
}

std::string AuditLog::head() const {
  proofs();
  return cut_off_.empty() ? chain_.head() : sha256_of(chain_.covered + cut_off_ + "\n");
}

bool AuditLog::has_registration(const std::string& session, const std::string& record_sha256) const {
  return has(proofs().registrations, session, record_sha256);
}

bool AuditLog::has_been_released(const std::string& session) const { return proofs().releases.contains(session); }

bool AuditLog::has_release(const std::string& session, const std::string& release_sha256) const {
  return has(proofs().releases, session, release_sha256);
}

std::size_t AuditLog::release_number(const std::string& session) const {
  const std::map<std::string, std::size_t>& numbers = proofs().release_numbers;
  const auto found = numbers.find(session);
  return found == numbers.end() ? 0 : found->second;
}

std::string AuditLog::newest_objection(const std::string& session) const {
  const auto found = proofs().objections.find(session);
  return found == proofs().objections.end() ? "" : found->second;
}

std::string AuditLog::newest_statement(const std::string& event, const std::string& session) const {
  const auto found = proofs().statements.find({event, session});
  return found == proofs().statements.end() ? "" : found->second;
}

std::string AuditLog::made_of_hand_over(const std::string& statement) const {
  const auto found = proofs().taken_over.find(statement);
  return found == proofs().taken_over.end() ? "" : found->second;
}

std::set<std::string> AuditLog::sessions_with(const std::string& event) const {
  std::set<std::string> sessions;
  for (const auto& [of, sha256] : proofs().statements)
    if (of.first == event) sessions.insert(of.second);
  return sessions;
}

bool AuditLog::has_sending(const std::string& session, const std::string& peer,
                           const std::string& object_sha256) const {
  Proofs kept;
  for (const Json& line : kept_) kept.add(line);
  const std::array sending = {session, peer, object_sha256};
  return kept.sendings.contains(sending) || proofs().sendings.contains(sending);
}

std::optional<std::string> AuditLog::session_releasing(const std::string& object_sha256) const {
  const auto found = proofs().objects.find(object_sha256);
  return found == proofs().objects.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace isoshift
