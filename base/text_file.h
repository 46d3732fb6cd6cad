#pragma once

#include <filesystem>
#include <string>

namespace isoshift {

// Throws Error naming the path if it is a pipe, a socket or a device: reading it may never end. Does nothing for a path
// that is not there.
void expect_no_pipe(const std::filesystem::path& path);

// All bytes of a file. Throws Error naming it if it is no file or cannot be read.
std::string text_of_file(const std::filesystem::path& path);

}  // namespace isoshift
