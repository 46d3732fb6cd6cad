#include "base/output_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdio.h>  // renameat2
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <mutex>
#include <set>
#include <string>

#include "base/error.h"
#include "base/option_name.h"
#include "base/random_word.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr const char* kListing = ".isoshift";
constexpr const char* kAside = ".partial";  // ends the name under which replace_text() writes first

// Staging folders of this process, for abandon_outputs().
std::mutex unfinished_mutex;
std::set<fs::path> unfinished;

// Every failure to write is told the same way: what, where, why, and that nothing was left behind.
[[noreturn]] void fail(const fs::path& path, const std::string& why) {
  throw WriteError(fmt::format("{}: cannot be written: {}\n       No result was left behind", path.string(), why));
}

std::set<fs::path> files_in(const fs::path& folder) {
  std::set<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (!entry.is_directory()) files.insert(entry.path().lexically_relative(folder));
  return files;
}

// The first file that no output folder wrote there; empty where there is none.
fs::path foreign_file(const fs::path& folder) {
  std::set<fs::path> ours = {kListing};
  std::ifstream listing(folder / kListing);
  for (std::string line; std::getline(listing, line);) ours.insert(line);
  for (const fs::path& file : files_in(folder))
    if (!ours.contains(file)) return file;
  return {};
}

void check_replaceable(const fs::path& destination, bool overwrite) {
  if (!fs::is_directory(destination))
    throw Error(fmt::format("{}: is a file, expected a folder", destination.string()));
  if (fs::is_empty(destination)) return;
  if (!overwrite)
    throw Error(
        fmt::format("{}: the output folder is not empty.\n"
                    "       Name another one, or replace what it holds: {}",
                    destination.string(), option("overwrite")));
  if (const fs::path foreign = foreign_file(destination); !foreign.empty())
    throw Error(
        fmt::format("{}: was not written by isoshift, so {} does not replace its folder.\n"
                    "       Move it away, or name another output folder",
                    (destination / foreign).string(), option("overwrite")));
}

// What is read must not be replaced by what is written.
void check_holds_none_of(const fs::path& destination, const std::vector<fs::path>& inputs) {
  const fs::path place = fs::weakly_canonical(destination);
  for (const fs::path& input : inputs) {
    const fs::path found = input.empty() ? fs::path() : fs::weakly_canonical(input);
    if (std::ranges::mismatch(place, found).in1 == place.end())
      throw Error(fmt::format("{}: holds {}, which is read.\n       Name another output folder", destination.string(),
                              input.string()));
  }
}

}  // namespace

void flush(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail(path, std::strerror(errno));
  const int failed = ::fsync(descriptor);
  const int reason = errno;
  ::close(descriptor);
  if (failed != 0) fail(path, std::strerror(reason));
}

OutputFolder::OutputFolder(fs::path destination, bool overwrite, const std::vector<fs::path>& inputs)
    : destination_(std::move(destination)) {
  if (destination_.empty()) throw UsageError("the name of the output folder is empty");
  destination_ = fs::absolute(destination_).lexically_normal();
  if (destination_.filename().empty()) destination_ = destination_.parent_path();  // "out/" is "out"
  std::error_code error;
  if (fs::is_symlink(destination_, error)) {
    if (!fs::exists(destination_, error))
      throw Error(fmt::format("{}: is a link to a folder that is not there", destination_.string()));
    destination_ = fs::canonical(destination_);
  }
  if (fs::exists(destination_, error)) {
    check_replaceable(destination_, overwrite);
    check_holds_none_of(destination_, inputs);
    replaces_ = !fs::is_empty(destination_);
  }
  make_parents();
  const std::string staging = destination_.string() + ".partial-" + random_word().substr(0, 8);
  const std::lock_guard lock(unfinished_mutex);
  if (::mkdir(staging.c_str(), 0777) != 0) {
    const int reason = errno;
    for (auto parent = made_parents_.rbegin(); parent != made_parents_.rend(); ++parent) fs::remove(*parent, error);
    fail(destination_, std::strerror(reason));
  }
  staging_ = staging;
  unfinished.insert(staging_);
}

void OutputFolder::make_parents() {
  std::vector<fs::path> missing;
  for (fs::path parent = destination_.parent_path(); !fs::exists(parent); parent = parent.parent_path())
    missing.push_back(parent);
  std::error_code error;
  for (auto parent = missing.rbegin(); parent != missing.rend(); ++parent) {
    fs::create_directory(*parent, error);
    if (error) fail(*parent, error.message());
    made_parents_.push_back(*parent);
  }
}

OutputFolder::~OutputFolder() {
  if (staging_.empty()) return;
  std::error_code ignored;  // nothing can be done about it here, and what remains is marked .partial
  fs::remove_all(staging_, ignored);
  for (auto parent = made_parents_.rbegin(); parent != made_parents_.rend(); ++parent) fs::remove(*parent, ignored);
  const std::lock_guard lock(unfinished_mutex);
  unfinished.erase(staging_);
}

void OutputFolder::commit() {
  std::string listing;
  for (const fs::path& file : files_in(staging_)) listing += file.string() + "\n";
  write_text(staging_ / kListing, listing);
  for (const fs::path& file : files_in(staging_)) flush(staging_ / file);
  flush(staging_);

  // An earlier output changes places with the new one, and is then removed from the staging name. Without one, a rename
  // takes an empty folder's place and fails if anything has appeared there meanwhile.
  const unsigned flags = replaces_ ? RENAME_EXCHANGE : 0;
  std::unique_lock lock(unfinished_mutex);  // abandon_outputs() removes it whole, or not at all
  if (::renameat2(AT_FDCWD, staging_.c_str(), AT_FDCWD, destination_.c_str(), flags) != 0)
    fail(destination_, std::strerror(errno));
  unfinished.erase(staging_);
  lock.unlock();
  flush(destination_.parent_path());
  std::error_code ignored;
  if (replaces_) fs::remove_all(staging_, ignored);
  staging_.clear();
}

void abandon_outputs() noexcept {
  // The lock is kept: whoever writes now must not go on.
  unfinished_mutex.lock();
  std::error_code ignored;
  for (const fs::path& staging : unfinished) fs::remove_all(staging, ignored);
}

bool holds_files(const fs::path& folder) {
  if (!fs::exists(folder)) return false;
  return std::ranges::any_of(fs::directory_iterator(folder), [](const fs::directory_entry& entry) {
    const std::string name = entry.path().filename().string();
    return !(name.starts_with('.') && name.ends_with(kAside));
  });
}

void replace_text(const fs::path& path, std::string_view text) {
  const fs::path aside = path.parent_path() / fmt::format(".{}.{}{}", path.filename().string(), ::getpid(), kAside);
  std::error_code ignored;
  try {
    fs::remove(aside, ignored);
    write_text(aside, text);
    flush(aside);
    if (::rename(aside.c_str(), path.c_str()) != 0) fail(path, std::strerror(errno));
  } catch (...) {
    fs::remove(aside, ignored);
    throw;
  }
  flush(path.parent_path().empty() ? fs::path(".") : path.parent_path());
}

void write_text(const fs::path& path, std::string_view text) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640);
  if (descriptor < 0) fail(path, std::strerror(errno));
  while (!text.empty()) {
    const auto written = ::write(descriptor, text.data(), text.size());
    if (written < 0) {
      const int reason = errno;
      ::close(descriptor);
      ::unlink(path.c_str());
      fail(path, std::strerror(reason));
    }
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  if (::close(descriptor) != 0) fail(path, std::strerror(errno));
}

}  // namespace isoshift
