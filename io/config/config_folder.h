#pragma once
// Texts and files that a configuration file names. Paths are relative to the folder of that file.

#include <filesystem>
#include <string>

#include "base/json_file.h"

namespace isoshift {

class ConfigFolder {
 public:
  // Of the configuration file.
  explicit ConfigFolder(const std::filesystem::path& file) : folder_(std::filesystem::absolute(file).parent_path()) {}

  // A text with more than spaces.
  static std::string text(JsonSection& section, const char* key, const char* expected);
  std::filesystem::path place(JsonSection& section, const char* key, const char* expected) const;
  // A file that can be read.
  std::filesystem::path file(JsonSection& section, const char* key) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace isoshift
