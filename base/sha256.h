#pragma once
// SHA-256, hexadecimal: results name the files they were made from by it.

#include <filesystem>
#include <string>
#include <string_view>

namespace isoshift {

std::string sha256_of(std::string_view content);

// Throws Error for a file that cannot be read.
std::string sha256_of_file(const std::filesystem::path& path);

}  // namespace isoshift
