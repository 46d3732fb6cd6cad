#pragma once
// Files that only their owner may read: keys and passwords.

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

namespace isoshift {

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

// The file, open for reading. Throws Error if it cannot be read, or if other users can read or write it.
std::unique_ptr<std::FILE, FileCloser> open_secret(const std::filesystem::path& path);

// Its first line. Throws Error as open_secret() does, and for an empty one.
std::string secret_line(const std::filesystem::path& path);

}  // namespace isoshift
