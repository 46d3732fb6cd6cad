#pragma once
// The rows of Table 1 that were measured so far, a file for each.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

namespace isoshift {

class Table1Folder {
 public:
  // Makes the folder, or opens one of the same protocol. Throws Error if it holds anything else. An empty path keeps
  // nothing.
  Table1Folder(std::filesystem::path path, const nlohmann::ordered_json& protocol);

  // The row of a method in a cell, if it was measured. Throws Error if it was of another volume.
  std::optional<nlohmann::ordered_json> find(const nlohmann::ordered_json& cell, std::string_view method) const;

  void keep(const nlohmann::ordered_json& cell, const nlohmann::ordered_json& row) const;

 private:
  std::filesystem::path file_of(const nlohmann::ordered_json& cell, std::string_view method) const;

  std::filesystem::path path_;
};

}  // namespace isoshift
