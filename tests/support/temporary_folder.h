#pragma once
// A folder of its own for one test, gone with it.

#include <filesystem>

namespace isoshift {

class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::filesystem::path& parent = std::filesystem::temp_directory_path());
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path operator/(const std::filesystem::path& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

// A parent in memory, where the system has one: nothing that is written there waits for a disk.
std::filesystem::path memory_folder();

}  // namespace isoshift
