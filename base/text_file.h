#pragma once

#include <filesystem>
#include <string>

namespace isoshift {

// All bytes of a file. Throws Error naming it if it is a folder or cannot be read.
std::string text_of_file(const std::filesystem::path& path);

}  // namespace isoshift
