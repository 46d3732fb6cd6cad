#pragma once
// The folder of a batch: what is registered how, and a folder for every case that has ended. It is the only memory of a
// batch, so that one that was stopped goes on.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/file_lock.h"
#include "workflow/batch/batch_manifest.h"

namespace isoshift {

inline constexpr const char* kErrorFile = "error.json";

// Part `number` (from 1) of `count` parts of a batch.
struct Shard {
  int number = 1, count = 1;
};

struct ShardLock {
  std::optional<FileLock> count, shard;
};

class BatchFolder {
 public:
  // Makes the folder, or opens that of a batch with the same options. Throws Error if it holds anything else.
  BatchFolder(std::filesystem::path path, const std::vector<std::string>& options);

  // While the lock lasts nobody else works on this shard; what a killed run left half written is removed. Throws Error
  // where somebody does.
  [[nodiscard]] ShardLock work_on(const Shard& shard, const std::vector<BatchCase>& cases) const;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path folder_of(const std::string& name) const { return path_ / "cases" / name; }
  bool has_ended(const std::string& name) const { return std::filesystem::exists(folder_of(name)); }

  // Puts an error in the place of the case's result, unless there is one already.
  void fail(const std::string& name, const std::string& message) const;

 private:
  std::filesystem::path path_;
};

}  // namespace isoshift
