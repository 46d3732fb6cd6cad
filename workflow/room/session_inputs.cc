#include "workflow/room/session_inputs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <functional>
#include <iterator>
#include <vector>

#include "base/error.h"
#include "base/sha256.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

using Files = std::vector<fs::path>;

std::string sha256_of_all(const Files& files, const std::function<std::string(const fs::path&)>& of_file) {
  std::vector<std::string> all;
  all.reserve(files.size());
  for (const fs::path& file : files) all.push_back(of_file(file));
  std::ranges::sort(all);
  return isoshift::sha256_of(fmt::format("{}", fmt::join(all, "\n")));
}

SessionInputs::Part input_of(const Files& files, const FileContents& contents, const SessionInputs::Part& before) {
  SessionInputs::Part part;
  part.versions = sha256_of_all(files, [&](const fs::path& file) { return contents.version(file); });
  part.contents = part.versions == before.versions
                      ? before.contents
                      : sha256_of_all(files, [&](const fs::path& file) { return contents.sha256(file); });
  return part;
}

}  // namespace

std::array<Files, SessionInputs::kParts.size()> files_of(const StudyParts& parts) {
  const auto one = [](const fs::path& file) { return file.empty() ? Files() : Files{file}; };
  Files structures = one(parts.structures);
  std::ranges::copy(parts.unused_structures.rivals, std::back_inserter(structures));
  return {parts.ct, one(parts.plan), structures, parts.images};
}

// A copy can be given the time of writing of the file that it replaces, but not its number and its time of change.
std::string FileContents::version(const fs::path& file) const {
  struct stat status{};
  if (::stat(file.c_str(), &status) != 0)
    throw Error(fmt::format("{}: cannot be read: {}", file.string(), std::strerror(errno)));
  const timespec &written = status.st_mtim, &changed = status.st_ctim;
  return fmt::format("{} {} {}.{:09} {} {}.{:09}", file.string(), status.st_size, written.tv_sec, written.tv_nsec,
                     status.st_ino, changed.tv_sec, changed.tv_nsec);
}

std::string FileContents::sha256(const fs::path& file) const { return sha256_of_file(file); }

SessionInputs inputs_of(const StudyParts& parts, const FileContents& contents) {
  return inputs_of(parts, contents, {});
}

SessionInputs inputs_of(const StudyParts& parts, const FileContents& contents, const SessionInputs& before) {
  const auto files = files_of(parts);
  SessionInputs inputs;
  for (std::size_t n = 0; n < files.size(); ++n) inputs.parts[n] = input_of(files[n], contents, before.parts[n]);
  return inputs;
}

std::string what_changed(const SessionInputs& before, const SessionInputs& now) {
  std::vector<std::string> changed;
  for (std::size_t n = 0; n < before.parts.size(); ++n)
    if (before.parts[n].contents != now.parts[n].contents) changed.emplace_back(SessionInputs::kParts[n]);
  return fmt::format("{}", fmt::join(changed, " and "));
}

std::string what_changed(const SessionInputs& before, const StudyParts& parts, const FileContents& contents) {
  SessionInputs now = before;
  const auto files = files_of(parts);
  for (std::size_t n = 0; n < files.size(); ++n) {
    try {
      now.parts[n] = input_of(files[n], contents, before.parts[n]);
    } catch (const Error&) {
      continue;  // a file is gone
    }
  }
  return what_changed(before, now);
}

nlohmann::ordered_json json_of(const SessionInputs& inputs) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  for (std::size_t n = 0; n < inputs.parts.size(); ++n)
    json[SessionInputs::kParts[n]] = {{"versions", inputs.parts[n].versions}, {"contents", inputs.parts[n].contents}};
  return json;
}

SessionInputs session_inputs_from(const nlohmann::json& json) {
  SessionInputs inputs;
  for (std::size_t n = 0; n < inputs.parts.size(); ++n) {
    const nlohmann::json& part = json.at(SessionInputs::kParts[n]);
    inputs.parts[n] = {.versions = part.at("versions"), .contents = part.at("contents")};
  }
  return inputs;
}

}  // namespace isoshift
