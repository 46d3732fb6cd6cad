#include "workflow/batch/batch_folder.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "io/report/result_folder.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBatchFile = "batch.json";

// More than a batch that was killed before it began leaves.
bool holds_something(const fs::path& folder) {
  for (const auto& entry : fs::directory_iterator(folder))
    if (!entry.path().filename().string().starts_with('.') &&
        !(entry.path().filename() == "cases" && entry.is_directory() && fs::is_empty(entry.path())))
      return true;
  return false;
}

}  // namespace

BatchFolder::BatchFolder(fs::path path, const std::vector<std::string>& options) : path_(std::move(path)) {
  if (path_.empty()) throw UsageError("the name of the output folder is empty");
  const fs::path file = path_ / kBatchFile;
  if (fs::exists(file)) {
    const auto before = read_json_file(file).json.value("options", std::vector<std::string>());
    if (before != options)
      throw Error(fmt::format(
          "{}: holds a batch that was begun {}\n       Name another output folder, or give the "
          "same options to go on",
          path_.string(),
          before.empty() ? "without options" : fmt::format("with other options: {}", fmt::join(before, " "))));
    return;
  }
  if (fs::exists(path_) && (!fs::is_directory(path_) || holds_something(path_)))
    throw Error(
        fmt::format("{}: exists already and holds no batch.\n       Name another output folder", path_.string()));
  std::error_code error;
  fs::create_directories(path_ / "cases", error);
  if (error) throw Error(fmt::format("{}: cannot be made: {}", path_.string(), error.message()));
  replace_text(file, json_text(nlohmann::ordered_json{{"schema", 1}, {"options", options}}));
}

ShardLock BatchFolder::work_on(const Shard& shard, const std::vector<BatchCase>& cases) const {
  // Shards of one count share no case; those of another count do.
  const std::string same = fmt::format(".shards-of-{}.lock", shard.count);
  ShardLock lock{.count = FileLock::try_take(path_ / same, FileLock::Kind::kShared),
                 .shard = FileLock::try_take(path_ / fmt::format(".shard-{}-of-{}.lock", shard.number, shard.count))};
  bool is_alone = lock.count && lock.shard;
  for (const auto& entry : fs::directory_iterator(path_)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(".shards-of-") && name != same) is_alone = is_alone && FileLock::try_take(entry.path());
  }
  if (!is_alone) throw Error(fmt::format("{}: another isoshift batch is working on it", path_.string()));
  for (const auto& entry : fs::directory_iterator(path_ / "cases")) {
    const std::string name = entry.path().filename().string();
    const auto is_left_by = [&](const BatchCase& one) { return name.starts_with(one.name + ".partial-"); };
    if (std::ranges::any_of(cases, is_left_by)) fs::remove_all(entry.path());
  }
  return lock;
}

void BatchFolder::set_aside(const std::string& name) const {
  if (!fs::exists(folder_of(name) / kResultFile)) {  // an error is no result
    fs::remove_all(folder_of(name));
    return;
  }
  const fs::path folder = path_ / "superseded";
  fs::create_directories(folder);
  fs::path to = folder / name;
  for (int n = 2; fs::exists(to); ++n) to = folder / fmt::format("{}-{}", name, n);
  fs::rename(folder_of(name), to);
}

std::vector<std::string> BatchFolder::set_aside_regrouped(const std::vector<BatchCase>& cases) const {
  std::set<std::string> names, uids;
  for (const BatchCase& one : cases) {
    names.insert(one.name);
    uids.insert(one.xray_uids.begin(), one.xray_uids.end());
  }
  std::vector<std::string> regrouped;
  for (const auto& entry : fs::directory_iterator(path_ / "cases")) {
    const std::string name = entry.path().filename().string();
    if (names.contains(name) || !fs::exists(entry.path() / kResultFile)) continue;
    const SetupResult result = read_report(entry.path());
    if (std::ranges::any_of(result.views, [&](const auto& view) { return uids.contains(view.sop_instance_uid); }))
      regrouped.push_back(name);
  }
  for (const std::string& name : regrouped) set_aside(name);
  return regrouped;
}

void BatchFolder::fail(const std::string& name, const std::string& message) const {
  if (has_ended(name)) return;
  OutputFolder output(folder_of(name), false);
  write_text(output.path() / kErrorFile, json_text(nlohmann::ordered_json{{"schema", 1}, {"error", message}}));
  output.commit();
}

}  // namespace isoshift
