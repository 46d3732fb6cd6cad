#include "base/text_file.h"

#include <fmt/format.h>

#include <fstream>
#include <iterator>

#include "base/error.h"

namespace isoshift {

void expect_no_pipe(const std::filesystem::path& path) {
  std::error_code failed;
  const std::filesystem::file_status status = std::filesystem::status(path, failed);
  if (std::filesystem::is_other(status))
    throw Error(fmt::format("{}: is a pipe, a socket or a device, expected a file", path.string()));
}

std::string text_of_file(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) throw Error(fmt::format("{}: is a folder, expected a file", path.string()));
  expect_no_pipe(path);
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw Error(fmt::format("{}: cannot be read", path.string()));
  return text;
}

}  // namespace isoshift
