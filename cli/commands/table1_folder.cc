#include "cli/commands/table1_folder.h"

#include <fmt/format.h>

#include <cctype>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"

namespace isoshift {
namespace {

constexpr const char* kProtocolFile = "protocol.json";

// Whatever the order of keys.
bool is_same(const nlohmann::json& kept, const nlohmann::ordered_json& now) { return kept == nlohmann::json(now); }

}  // namespace

Table1Folder::Table1Folder(std::filesystem::path path, const nlohmann::ordered_json& protocol)
    : path_(std::move(path)) {
  if (path_.empty()) return;
  if (std::filesystem::exists(path_ / kProtocolFile)) {
    if (!is_same(read_json_file(path_ / kProtocolFile).json, protocol))
      throw Error(
          fmt::format("{}: holds rows of another protocol, machine or program (protocol.json says which).\n       "
                      "Choose another folder with -o, or remove this one",
                      path_.string()));
    return;
  }
  if (holds_files(path_))
    throw Error(
        fmt::format("{}: exists and holds no rows of Table 1.\n       Choose another folder with -o", path_.string()));
  std::filesystem::create_directories(path_);
  replace_text(path_ / kProtocolFile, json_text(protocol));
}

// "spine phantom", -380, "ours: cpu" -> spine-phantom-380-hu-ours-cpu.json
std::filesystem::path Table1Folder::file_of(const nlohmann::ordered_json& cell, std::string_view method) const {
  const std::string words =
      fmt::format("{} {} HU {}", cell.at("volume").get<std::string>(), cell.at("threshold_hu").get<double>(), method);
  std::string name;
  for (const char c : words) {
    const auto letter = static_cast<unsigned char>(c);
    if (std::isalnum(letter) != 0)
      name += static_cast<char>(std::tolower(letter));
    else if (!name.empty() && name.back() != '-')
      name += '-';
  }
  while (name.ends_with('-')) name.pop_back();
  return path_ / (name + ".json");
}

std::optional<nlohmann::ordered_json> Table1Folder::find(const nlohmann::ordered_json& cell,
                                                         std::string_view method) const {
  if (path_.empty()) return std::nullopt;
  const std::filesystem::path file = file_of(cell, method);
  if (!std::filesystem::exists(file)) return std::nullopt;
  const nlohmann::json kept = read_json_file(file).json;
  if (!is_same(kept.at("cell"), cell))
    throw Error(
        fmt::format("{}: was measured on another volume.\n       Choose another folder with -o, or the --ct "
                    "of then",
                    file.string()));
  return nlohmann::ordered_json(kept.at("row"));
}

void Table1Folder::keep(const nlohmann::ordered_json& cell, const nlohmann::ordered_json& row) const {
  if (path_.empty()) return;
  replace_text(file_of(cell, row.at("method").get<std::string>()),
               json_text(nlohmann::ordered_json{{"cell", cell}, {"row", row}}));
}

}  // namespace isoshift
