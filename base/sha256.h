#pragma once
// SHA-256, hexadecimal: results name the files they were made from by it.

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

struct evp_md_ctx_st;  // of OpenSSL

namespace isoshift {

// Of bytes that come in pieces.
class Sha256 {
 public:
  Sha256();
  void add(std::string_view piece);
  std::string hex();  // of all pieces; once

 private:
  std::unique_ptr<evp_md_ctx_st, void (*)(evp_md_ctx_st*)> context_;
};

std::string sha256_of(std::string_view content);

// Throws Error for a file that cannot be read.
std::string sha256_of_file(const std::filesystem::path& path);

// Of the contents of all files in their order. Throws Error for a file that cannot be read.
std::string sha256_of_files(const std::vector<std::filesystem::path>& paths);

// Of every file of a folder, by name. Throws Error if the folder holds anything but plain files: a link could lead to
// another file tomorrow, and a folder would hide files.
std::map<std::string, std::string> sha256_of_folder(const std::filesystem::path& folder);

}  // namespace isoshift
