#pragma once
// The bytes of a file, read in pieces: a file may be larger than the memory, and most of it is never looked at.

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace isoshift {

class FileBytes {
 public:
  static constexpr std::size_t kLongestPiece = std::size_t{1} << 20;

  // Throws Error if the path is no file, or the file cannot be read.
  explicit FileBytes(std::filesystem::path path);
  // Bytes that are in memory already, and stay there as long as this object; `path` is their name in messages.
  FileBytes(std::string_view bytes, std::filesystem::path path);
  ~FileBytes();
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t size() const { return size_; }

  // Up to kLongestPiece bytes from `at` on, fewer at the end of the file; valid until the next call.
  std::string_view piece(std::uint64_t at, std::size_t count);

  // All of them. Throws Error if there are more than `max`.
  std::string whole(std::uint64_t max);

 private:
  std::filesystem::path path_;
  std::uint64_t size_ = 0;
  int descriptor_ = -1;
  std::string buffer_;           // of a file
  std::uint64_t buffer_at_ = 0;  // where in the file it begins
  std::string_view in_memory_;
};

}  // namespace isoshift
