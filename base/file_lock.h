#pragma once
// One process at a time: a lock that the system takes back when its holder ends, however it ends.

#include <filesystem>
#include <optional>
#include <utility>

namespace isoshift {

class FileLock {
 public:
  // Takes the lock; returns nothing if another process holds it. The file remains. Throws Error if the file cannot be
  // made. kShared: other processes may share the lock, but none can take it alone.
  enum class Kind { kAlone, kShared };
  static std::optional<FileLock> try_take(const std::filesystem::path& path, Kind kind = Kind::kAlone);
  ~FileLock();
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&&) = delete;

  // False if the file was removed or replaced: then another process can take a lock of the same name.
  bool is_in_place() const;

 private:
  FileLock(std::filesystem::path path, int descriptor) : path_(std::move(path)), descriptor_(descriptor) {}

  std::filesystem::path path_;
  int descriptor_;
};

}  // namespace isoshift
