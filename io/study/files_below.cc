#include "io/study/files_below.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace isoshift {

namespace fs = std::filesystem;

std::vector<fs::path> files_below(const std::vector<fs::path>& paths, const std::unordered_set<std::string>& but,
                                  std::set<fs::path>* unsearchable) {
  std::vector<fs::path> files;
  const auto add = [&](const fs::path& file) {
    if (!but.contains(file.native())) files.push_back(file);
  };
  const auto cannot_search = [&](const fs::path& folder, const char* why) {
    if (unsearchable == nullptr) throw Error(fmt::format("{}: cannot be searched: {}", folder.string(), why));
    unsearchable->insert(folder);
  };
  for (const fs::path& path : paths) {
    std::error_code error;
    const auto status = fs::status(path, error);
    if (!fs::exists(status)) throw Error(fmt::format("{}: no such file or folder", path.string()));
    if (!fs::is_directory(status)) {
      add(path);
      continue;
    }
    for (auto entry = fs::recursive_directory_iterator(path, error); !error && entry != fs::end(entry);
         entry.increment(error)) {
      const bool is_hidden = entry->path().filename().native().starts_with('.');
      if (entry->is_symlink()) {
        if (is_hidden) continue;
        if (!entry->exists()) cannot_search(entry->path(), "a link to a file or folder that is not there");
        // What a link means is searched where it lies, or by its own name; no link leads round and round.
        else if (unsearchable != nullptr)
          unsearchable->insert(entry->path());
      } else if (entry->is_directory()) {
        if (::access(entry->path().c_str(), R_OK | X_OK) == 0) continue;
        cannot_search(entry->path(), std::strerror(errno));
        entry.disable_recursion_pending();
      } else if (!is_hidden && entry->is_regular_file()) {
        add(entry->path());
      }
    }
    if (error) throw Error(fmt::format("{}: cannot be searched: {}", path.string(), error.message()));
  }
  std::ranges::sort(files);
  files.erase(std::unique(files.begin(), files.end()), files.end());
  return files;
}

bool is_link_to_something(const fs::path& unsearchable) {
  return fs::is_symlink(unsearchable) && fs::exists(unsearchable);
}

std::string why_not_searched(const fs::path& unsearchable) {
  if (is_link_to_something(unsearchable))
    return fmt::format("{}: a link, which is not followed: name what it leads to, {}", unsearchable.string(),
                       fs::canonical(unsearchable).string());
  return fmt::format("{}: cannot be searched: it may not be opened, or is a link to what is not there",
                     unsearchable.string());
}

}  // namespace isoshift
