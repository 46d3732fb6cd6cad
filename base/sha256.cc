#include "base/sha256.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include <array>
#include <fstream>

#include "base/error.h"
#include "base/text_file.h"

namespace isoshift {

namespace {

void check(int done) {
  if (done != 1) throw Error("SHA-256 is not available");
}

}  // namespace

Sha256::Sha256() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
  check(EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr));
}

void Sha256::add(std::string_view piece) { check(EVP_DigestUpdate(context_.get(), piece.data(), piece.size())); }

std::string Sha256::hex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  check(EVP_DigestFinal_ex(context_.get(), digest.data(), &size));
  return fmt::format("{:02x}", fmt::join(digest.begin(), digest.begin() + size, ""));
}

std::string sha256_of(std::string_view content) {
  Sha256 sha256;
  sha256.add(content);
  return sha256.hex();
}

std::string sha256_of_file(const std::filesystem::path& path) {
  expect_no_pipe(path);
  std::ifstream file(path, std::ios::binary);
  Sha256 sha256;
  std::array<char, 65536> piece{};
  while (file.read(piece.data(), piece.size()) || file.gcount() > 0)
    sha256.add({piece.data(), static_cast<std::size_t>(file.gcount())});
  if (!file.eof()) throw Error(fmt::format("{}: cannot be read", path.string()));
  return sha256.hex();
}

std::string sha256_of_files(const std::vector<std::filesystem::path>& paths) {
  std::string all;
  for (const std::filesystem::path& path : paths) all += sha256_of_file(path);
  return sha256_of(all);
}

std::map<std::string, std::string> sha256_of_folder(const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  const fs::file_status status = fs::symlink_status(folder);
  if (!fs::exists(status)) throw Error(fmt::format("{}: is missing", folder.string()));
  if (!fs::is_directory(status)) throw Error(fmt::format("{}: is not a plain folder", folder.string()));
  std::map<std::string, std::string> all;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.symlink_status().type() != fs::file_type::regular)
      throw Error(fmt::format("{}: is not a plain file", entry.path().string()));
    all[entry.path().filename().string()] = sha256_of_file(entry.path());
  }
  return all;
}

}  // namespace isoshift
