#include "cli/batch_folder.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "geometry/error.h"
#include "io/json_file.h"
#include "io/output_folder.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBatchFile = "batch.json";

}  // namespace

BatchFolder::BatchFolder(fs::path path, const std::vector<std::string>& options) : path_(std::move(path)) {
  if (path_.empty()) throw UsageError("the name of the output folder is empty");
  const fs::path file = path_ / kBatchFile;
  if (fs::exists(file)) {
    const auto before = read_json_file(file).json.value("options", std::vector<std::string>());
    if (before != options)
      throw Error(
          fmt::format("{}: holds a batch with other options: {}\n       Name another output folder, or give the "
                      "same options to go on",
                      path_.string(), before.empty() ? "none" : fmt::format("{}", fmt::join(before, " "))));
    return;
  }
  if (fs::exists(path_) && (!fs::is_directory(path_) || !fs::is_empty(path_)))
    throw Error(
        fmt::format("{}: is there already and holds no batch.\n       Name another output folder", path_.string()));
  std::error_code error;
  fs::create_directories(path_ / "cases", error);
  if (error) throw Error(fmt::format("{}: cannot be made: {}", path_.string(), error.message()));
  replace_text(file, nlohmann::ordered_json{{"schema", 1}, {"options", options}}.dump(2) + "\n");
}

FileLock BatchFolder::work_on(const Shard& shard, const std::vector<BatchCase>& cases) const {
  std::optional<FileLock> lock =
      FileLock::try_take(path_ / fmt::format(".shard-{}-of-{}.lock", shard.number, shard.count));
  if (!lock) throw Error(fmt::format("{}: another isoshift batch is working on it", path_.string()));
  for (const auto& entry : fs::directory_iterator(path_ / "cases")) {
    const std::string name = entry.path().filename().string();
    const auto is_left_by = [&](const BatchCase& one) { return name.starts_with(one.name + ".partial-"); };
    if (std::ranges::any_of(cases, is_left_by)) fs::remove_all(entry.path());
  }
  return *std::move(lock);
}

void BatchFolder::fail(const std::string& name, const std::string& message) const {
  if (has_ended(name)) return;
  OutputFolder output(folder_of(name), false);
  write_text(output.path() / kErrorFile, nlohmann::ordered_json{{"schema", 1}, {"error", message}}.dump(2) + "\n");
  output.commit();
}

}  // namespace isoshift
