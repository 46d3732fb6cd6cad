#include "base/secret_file.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace isoshift {

std::unique_ptr<std::FILE, FileCloser> open_secret(const std::filesystem::path& path) {
  std::unique_ptr<std::FILE, FileCloser> file(std::fopen(path.c_str(), "rbe"));
  struct stat status{};
  if (!file || ::fstat(::fileno(file.get()), &status) != 0)
    throw Error(fmt::format("{}: cannot be read: {}", path.string(), std::strerror(errno)));
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0)
    throw Error(fmt::format("{}: other users can read or write this file, which must be secret: chmod 600 {}",
                            path.string(), path.string()));
  return file;
}

std::string secret_line(const std::filesystem::path& path) {
  constexpr std::size_t kLongest = 1024;
  const auto file = open_secret(path);
  std::array<char, kLongest> line{};
  std::string secret;
  if (std::fgets(line.data(), static_cast<int>(line.size()), file.get()) != nullptr) secret = line.data();
  while (secret.ends_with('\n') || secret.ends_with('\r')) secret.pop_back();
  if (secret.empty()) throw Error(fmt::format("{}: its first line is empty, expected a secret", path.string()));
  return secret;
}

}  // namespace isoshift
