#include "workflow/room/session_record.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/json_file.h"
#include "base/local_time.h"
#include "base/sha256.h"
#include "io/report/result_folder.h"
#include "io/study/session_files.h"

namespace isoshift {

namespace fs = std::filesystem;

std::string name_of_xrays(const std::string& session, int number) {
  const std::string first = session.substr(0, session.find('-'));
  return number == 1 ? first : fmt::format("{}-{}", first, number);
}

std::set<std::string> xrays_of(const fs::path& folder) {
  const nlohmann::json result = read_json_file(folder / kResultFile).json;
  std::set<std::string> xrays;
  try {
    for (const nlohmann::json& view : result.at("views")) xrays.insert(view.at("sop_instance_uid").get<std::string>());
  } catch (const nlohmann::json::exception&) {
    throw Error(fmt::format("{}: is not a result of isoshift register", (folder / kResultFile).string()));
  }
  return xrays;
}

SessionRecord record_of(const std::string& session, const fs::path& folder, const FileHashes& made) {
  SessionRecord record{
      .session = session, .verdict = "", .on = local_time(), .pose_set_by = "", .files = made, .sha256 = ""};
  check_unchanged(record, folder);
  const JsonFile file = read_json_file(folder / kResultFile);
  if (made.at(kResultFile) != file.sha256)
    throw Error(fmt::format("{}: is being changed", (folder / kResultFile).string()));
  const nlohmann::json& result = file.json;
  try {
    record.verdict = result.at("verdict").get<std::string>();
    if (const nlohmann::json start = result.value("start", nlohmann::json()); !result.value("searched", true))
      if (const nlohmann::json& who = start.at("set_by"); who.is_string()) record.pose_set_by = who;
  } catch (const nlohmann::json::exception&) {
    throw Error(fmt::format("{}: is not a result of isoshift register", (folder / kResultFile).string()));
  }
  if (const std::string name = session_name(xrays_of(folder)); name != name_of_xrays(session))
    throw Error(fmt::format("{}: is the result of other X-rays: those of session {}, expected {}",
                            (folder / kResultFile).string(), name, session));
  return record;
}

std::string json_of(const SessionRecord& record) {
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (const auto& [file, sha256] : record.files) files.push_back({{"file", file}, {"sha256", sha256}});
  return json_text(nlohmann::ordered_json{{"schema", 1},
                                          {"session", record.session},
                                          {"verdict", record.verdict},
                                          {"on", record.on},
                                          {"pose_set_by", record.pose_set_by},
                                          {"files", files}});
}

SessionRecord read_session_record(const fs::path& path) {
  const JsonFile file = read_json_file(path);
  try {
    SessionRecord record{.session = file.json.at("session"),
                         .verdict = file.json.at("verdict"),
                         .on = file.json.at("on"),
                         .pose_set_by = file.json.value("pose_set_by", ""),  // older records have none
                         .files = {},
                         .sha256 = file.sha256};
    for (const nlohmann::json& entry : file.json.at("files"))
      record.files[entry.at("file").get<std::string>()] = entry.at("sha256").get<std::string>();
    return record;
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: is not a record of a registered session: {}", path.string(), error.what()));
  }
}

void check_unchanged(const SessionRecord& record, const fs::path& folder) {
  const std::map<std::string, std::string> found = sha256_of_folder(folder);
  for (const auto& [file, sha256] : record.files) {
    const auto same = found.find(file);
    if (same == found.end()) throw Error(fmt::format("{}: is missing", (folder / file).string()));
    if (same->second != sha256)
      throw Error(fmt::format("{}: is not what was registered: its SHA-256 is {}, expected {}",
                              (folder / file).string(), same->second, sha256));
  }
  for (const auto& [file, sha256] : found)
    if (!record.files.contains(file))
      throw Error(fmt::format("{}: was added after the registration", (folder / file).string()));
}

}  // namespace isoshift
