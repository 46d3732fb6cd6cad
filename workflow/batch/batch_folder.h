#pragma once
// The folder of a batch: its cases, its flags, and a folder for every case that has ended. A batch has no other memory,
// so a batch that was stopped continues from this folder.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/file_lock.h"
#include "workflow/batch/batch_manifest.h"

namespace isoshift {

inline constexpr const char* kErrorFile = "error.json";

// Shard `number` (from 1) of the `count` shards of a batch.
struct Shard {
  int number = 1, count = 1;
};

struct ShardLock {
  std::optional<FileLock> count, shard;
};

class BatchFolder {
 public:
  // Makes the folder, or opens the folder of a batch with the same options. Throws Error if it holds anything else.
  BatchFolder(std::filesystem::path path, const std::vector<std::string>& options);

  // While the lock exists, no other process works on this shard. Removes files that a killed run left half written.
  // Throws Error if another process works on this shard.
  [[nodiscard]] ShardLock work_on(const Shard& shard, const std::vector<BatchCase>& cases) const;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path folder_of(const std::string& name) const { return path_ / "cases" / name; }
  bool has_ended(const std::string& name) const { return std::filesystem::exists(folder_of(name)); }

  // Moves the result of a case to superseded/; of a failed case, removes the error.
  void set_aside(const std::string& name) const;
  // Moves the results of which an X-ray is in another case now to superseded/. Returns their names.
  std::vector<std::string> set_aside_regrouped(const std::vector<BatchCase>& cases) const;

  // Writes an error in place of the case's result, unless the case has ended already.
  void fail(const std::string& name, const std::string& message) const;

 private:
  std::filesystem::path path_;
};

}  // namespace isoshift
