#include "workflow/room/deletion.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "workflow/room/session_record.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

// Those whose files and folders are named after sessions.
constexpr std::array kFolders = {"sessions", "registered", "released", "sent",    "decided",
                                 "chosen",   "orders",     "inputs",   "by_hand", "handed_over"};

fs::path file_of(const fs::path& results, const std::string& session) {
  return results / "deleted" / (name_of_xrays(session) + ".json");
}

// The first session of the X-rays that a file or folder is named after: "NAME", "NAME-2", "NAME.json", "NAME-2.1.json",
// ".NAME.registering-7".
std::string first_session_of(const fs::path& entry) {
  std::string name = entry.filename().string();
  if (name.starts_with('.')) name.erase(0, 1);
  return name_of_xrays(name.substr(0, name.find('.')));
}

}  // namespace

void put_deletion(const fs::path& results, const Deletion& deletion) {
  const nlohmann::ordered_json json = {{"schema", 1},       {"session", deletion.session},
                                       {"by", deletion.by}, {"user", deletion.user},
                                       {"on", deletion.on}, {"xrays", deletion.xrays}};
  replace_text(file_of(results, deletion.session), json_text(json));
}

std::vector<Deletion> deletions(const fs::path& results) {
  std::vector<Deletion> all;
  for (const auto& entry : fs::directory_iterator(results / "deleted")) {
    if (entry.path().extension() != ".json" || entry.path().filename().string().starts_with('.')) continue;
    const nlohmann::json json = read_json_file(entry.path()).json;
    try {
      all.push_back({.session = json.at("session"),
                     .by = json.at("by"),
                     .user = json.at("user"),
                     .on = json.at("on"),
                     .xrays = json.at("xrays")});
    } catch (const nlohmann::json::exception& error) {
      throw Error(fmt::format("{}: does not tell what was deleted: {}", entry.path().string(), error.what()));
    }
  }
  std::ranges::sort(all, {}, &Deletion::session);
  return all;
}

bool is_deleted(const fs::path& results, const std::string& session) { return fs::exists(file_of(results, session)); }

void remove_deleted(const fs::path& results, const std::vector<Deletion>& deleted) {
  std::set<std::string> sessions;
  for (const Deletion& deletion : deleted) sessions.insert(deletion.session);
  std::vector<fs::path> own;
  for (const char* folder : kFolders)
    if (fs::exists(results / folder))
      for (const auto& entry : fs::directory_iterator(results / folder))
        if (sessions.contains(first_session_of(entry.path()))) own.push_back(entry.path());
  for (const fs::path& path : own) fs::remove_all(path);
}

}  // namespace isoshift
