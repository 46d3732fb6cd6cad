#include "io/output_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <vector>

#include "geometry/error.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

// Every failure to write is told the same way: what, where, why, and that nothing was left behind.
[[noreturn]] void fail(const fs::path& path, const std::string& why) {
  throw Error(fmt::format("{}: cannot be written: {}\n       No result was left behind", path.string(), why));
}

void flush(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail(path, std::strerror(errno));
  const int failed = ::fsync(descriptor);
  const int reason = errno;
  ::close(descriptor);
  if (failed != 0) fail(path, std::strerror(reason));
}

fs::path existing_parent(const fs::path& destination) {
  const fs::path parent = fs::absolute(destination).parent_path();
  std::error_code error;
  fs::create_directories(parent, error);
  if (error) fail(parent, error.message());
  return parent;
}

}  // namespace

OutputFolder::OutputFolder(fs::path destination, bool overwrite, std::vector<std::string> obsolete)
    : destination_(std::move(destination)), obsolete_(std::move(obsolete)) {
  if (destination_.filename().empty()) destination_ = destination_.parent_path();  // "out/" is "out"
  std::error_code error;
  if (fs::exists(destination_, error)) {
    if (!fs::is_directory(destination_))
      throw Error(fmt::format("{}: is a file, expected a folder", destination_.string()));
    if (!overwrite && !fs::is_empty(destination_))
      throw Error(
          fmt::format("{}: the output folder is not empty.\n       Name another one, or replace what it holds: "
                      "--overwrite",
                      destination_.string()));
  }
  std::string staging =
      (existing_parent(destination_) / (destination_.filename().string() + ".partial-XXXXXX")).string();
  if (::mkdtemp(staging.data()) == nullptr) fail(staging, std::strerror(errno));
  staging_ = staging;
}

OutputFolder::~OutputFolder() {
  std::error_code ignored;  // nothing can be done about it here, and what remains is marked .partial
  if (!staging_.empty()) fs::remove_all(staging_, ignored);
}

void OutputFolder::commit() {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(staging_)) {
    if (entry.is_regular_file()) {
      flush(entry.path());
      files.push_back(entry.path().lexically_relative(staging_));
    }
  }
  flush(staging_);
  fs::permissions(staging_, fs::perms::owner_all | fs::perms::group_read | fs::perms::group_exec);
  std::error_code error;
  fs::rename(staging_, destination_, error);  // replaces an empty folder, fails for any other
  if (error) {
    for (const std::string& name : obsolete_) fs::remove(destination_ / name);
    for (const fs::path& file : files) {
      fs::create_directories((destination_ / file).parent_path());
      fs::rename(staging_ / file, destination_ / file, error);
      if (error) fail(destination_ / file, error.message());
    }
    fs::remove_all(staging_);
  }
  staging_.clear();
  flush(existing_parent(destination_));
}

void write_text(const fs::path& path, std::string_view text) {
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0640);
  if (descriptor < 0) fail(path, std::strerror(errno));
  while (!text.empty()) {
    const auto written = ::write(descriptor, text.data(), text.size());
    if (written < 0) {
      const int reason = errno;
      ::close(descriptor);
      fail(path, std::strerror(reason));
    }
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  if (::close(descriptor) != 0) fail(path, std::strerror(errno));
}

}  // namespace isoshift
