#include "base/sha256.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include <array>
#include <fstream>
#include <sstream>

#include "base/error.h"

namespace isoshift {

std::string sha256_of(std::string_view content) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  if (EVP_Digest(content.data(), content.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1)
    throw Error("SHA-256 is not available");
  return fmt::format("{:02x}", fmt::join(digest.begin(), digest.begin() + size, ""));
}

std::string sha256_of_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream content;
  content << file.rdbuf();
  if (!file) throw Error(fmt::format("{}: cannot be read", path.string()));
  return sha256_of(content.view());
}

std::string sha256_of_files(const std::vector<std::filesystem::path>& paths) {
  std::string all;
  for (const std::filesystem::path& path : paths) all += sha256_of_file(path);
  return sha256_of(all);
}

}  // namespace isoshift
