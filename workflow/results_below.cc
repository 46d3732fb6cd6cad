#include "workflow/results_below.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "base/json_file.h"
#include "io/report/result_folder.h"
#include "workflow/batch/batch_folder.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr std::array kPutAside = {"superseded", "by_hand", "handed_over"};

// The folders below `top`, or `top` itself, that hold a file of this name, by path.
std::vector<fs::path> folders_with(const char* file, const fs::path& top) {
  if (!fs::is_directory(top)) throw Error(fmt::format("{}: is not a folder", top.string()));
  if (fs::exists(top / file)) return {top};
  std::vector<fs::path> folders;
  for (auto entry = fs::recursive_directory_iterator(top); entry != fs::recursive_directory_iterator(); ++entry) {
    if (!entry->is_directory()) continue;
    const std::string name = entry->path().filename().string();
    const bool has_file = fs::exists(entry->path() / file);
    if (has_file || name.starts_with('.') || std::ranges::find(kPutAside, name) != kPutAside.end())
      entry.disable_recursion_pending();
    if (has_file && !name.starts_with('.')) folders.push_back(entry->path());
  }
  std::ranges::sort(folders);
  return folders;
}

// Folders that hold this file, below `top`; a name that several folders of results or of errors have stands with the
// folders above it.
std::vector<NamedFolder> named_folders_with(const char* file, const fs::path& top) {
  std::map<std::string, int> counts;
  for (const char* each : {kResultFile, kErrorFile})
    for (const fs::path& folder : folders_with(each, top)) ++counts[folder.filename().string()];
  std::vector<NamedFolder> named;
  for (const fs::path& folder : folders_with(file, top)) {
    const std::string name = folder.filename().string();
    named.push_back({.name = counts[name] > 1 ? folder.lexically_relative(top).string() : name, .path = folder});
  }
  return named;
}

}  // namespace

std::vector<NamedFolder> result_folders_below(const fs::path& top) {
  std::vector<NamedFolder> folders = named_folders_with(kResultFile, top);
  if (folders.empty())
    throw Error(
        fmt::format("{}: holds no result of isoshift (no folder with {}). To register sessions: isoshift batch "
                    "SESSIONS -o RESULTS",
                    top.string(), kResultFile));
  return folders;
}

std::string NamedResult::acquired() const {
  std::string first;
  for (const SetupResult::View& view : result.views)
    if (!view.acquired.empty() && (first.empty() || view.acquired < first)) first = view.acquired;
  return first;
}

ResultsBelow results_below(const fs::path& top) {
  ResultsBelow found;
  for (const NamedFolder& folder : result_folders_below(top))
    found.results.push_back({.name = folder.name, .result = read_report(folder.path)});
  for (const NamedFolder& folder : named_folders_with(kErrorFile, top)) {
    const JsonFile file = read_json_file(folder.path / kErrorFile);
    JsonSection section(file.json, (folder.path / kErrorFile).string());
    found.failed.push_back(
        {.name = folder.name, .message = section.required<std::string>("error", "why the case failed")});
  }
  std::ranges::sort(found.results, {}, [](const NamedResult& one) { return std::tuple(one.acquired(), one.name); });
  return found;
}

void require_distinct(const std::vector<NamedResult>& results) {
  std::map<std::pair<std::string, int>, std::string> owners;  // of an X-ray, by instance and frame
  for (const NamedResult& one : results)
    for (const SetupResult::View& view : one.result.views) {
      const auto [owner, is_new] = owners.try_emplace({view.sop_instance_uid, view.frame}, one.name);
      if (!is_new && owner->second != one.name)
        throw Error(fmt::format("results {} and {} are of the same X-ray, {}, which would count twice: leave one out",
                                owner->second, one.name, view.sop_instance_uid));
    }
}

}  // namespace isoshift
