#pragma once
// SHA-256, hexadecimal: results name the files they were made from by it.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace isoshift {

std::string sha256_of(std::string_view content);

// Throws Error for a file that cannot be read.
std::string sha256_of_file(const std::filesystem::path& path);

// Of the contents of all files in their order. Throws Error for a file that cannot be read.
std::string sha256_of_files(const std::vector<std::filesystem::path>& paths);

}  // namespace isoshift
