#include "io/config/config_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include "base/error.h"

namespace isoshift {

std::string ConfigFolder::text(JsonSection& section, const char* key, const char* expected) {
  std::string text = section.required<std::string>(key, expected);
  if (text.find_first_not_of(' ') == std::string::npos) section.refuse(key, expected);
  return text;
}

std::filesystem::path ConfigFolder::place(JsonSection& section, const char* key, const char* expected) const {
  return (folder_ / text(section, key, expected)).lexically_normal();
}

std::filesystem::path ConfigFolder::file(JsonSection& section, const char* key) const {
  std::filesystem::path path = place(section, key, "the name of a file");
  if (::access(path.c_str(), R_OK) != 0)
    throw Error(fmt::format("{}: {}: {} cannot be read", section.where(), key, path.string()));
  return path;
}

}  // namespace isoshift
