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

// The folders below `top`, or `top` itself, by path.
struct Folders {
  std::vector<NamedFolder> of_results, of_errors;
};

// A name that several of them have stands with the folders above it.
void name(Folders& folders, const fs::path& top) {
  std::map<std::string, int> counts;
  for (const auto* some : {&folders.of_results, &folders.of_errors})
    for (const NamedFolder& folder : *some) ++counts[folder.path.filename().string()];
  for (auto* some : {&folders.of_results, &folders.of_errors})
    for (NamedFolder& folder : *some) {
      folder.name = folder.path.filename().string();
      if (counts[folder.name] > 1) folder.name = folder.path.lexically_relative(top).string();
    }
}

Folders folders_below(const fs::path& top) {
  if (!fs::is_directory(top)) throw Error(fmt::format("{}: is not a folder", top.string()));
  Folders folders;
  const auto take = [&](const fs::path& folder) {
    const bool is_result = fs::exists(folder / kResultFile);
    const bool is_taken = is_result || fs::exists(folder / kErrorFile);
    if (is_taken) (is_result ? folders.of_results : folders.of_errors).push_back({.name = {}, .path = folder});
    return is_taken;
  };
  if (!take(top))
    for (auto entry = fs::recursive_directory_iterator(top); entry != fs::recursive_directory_iterator(); ++entry) {
      if (!entry->is_directory()) continue;
      const std::string name = entry->path().filename().string();
      const bool is_unfinished = name.find(".partial-") != std::string::npos;
      if (name.starts_with('.') || is_unfinished || std::ranges::find(kPutAside, name) != kPutAside.end() ||
          take(entry->path()))
        entry.disable_recursion_pending();
    }
  for (auto* some : {&folders.of_results, &folders.of_errors}) std::ranges::sort(*some, {}, &NamedFolder::path);
  name(folders, top);
  if (folders.of_results.empty())
    throw Error(
        fmt::format("{}: holds no result of isoshift (no folder with {}). To register sessions: isoshift batch "
                    "SESSIONS -o RESULTS",
                    top.string(), kResultFile));
  return folders;
}

}  // namespace

std::vector<NamedFolder> result_folders_below(const fs::path& top) { return folders_below(top).of_results; }

std::string NamedResult::acquired() const {
  std::string first;
  for (const SetupResult::View& view : result.views)
    if (!view.acquired.empty() && (first.empty() || view.acquired < first)) first = view.acquired;
  return first;
}

ResultsBelow results_below(const fs::path& top) {
  ResultsBelow found;
  const Folders folders = folders_below(top);
  for (const NamedFolder& folder : folders.of_results)
    found.results.push_back({.name = folder.name, .result = read_report(folder.path)});
  for (const NamedFolder& folder : folders.of_errors) {
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
