#include "workflow/room/decision_files.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "workflow/room/signed_json.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

fs::path numbered(const fs::path& folder, const std::string& session, int number) {
  return folder / fmt::format("{}.{}.json", session, number);
}

int count_of(const fs::path& folder, const std::string& session) {
  int count = 0;
  while (fs::exists(numbered(folder, session, count + 1))) ++count;
  return count;
}

}  // namespace

std::optional<Decision> newest_decision(const fs::path& folder, const std::string& session, const AuditLog& audit,
                                        const std::optional<SigningKey>& key) {
  const int count = count_of(folder, session);
  const std::string proven = audit.newest_decision(session);
  if (count == 0 && proven.empty()) return std::nullopt;
  const fs::path path = numbered(folder, session, count);
  const auto refuse = [&](const std::string& why) -> Error {
    return Error(fmt::format("session {}: {}. Nothing of the session is released or sent until a person decides again",
                             session, why));
  };
  if (count == 0) throw refuse(fmt::format("audit.jsonl tells of a decision that {} does not hold", folder.string()));
  const JsonFile file = read_json_file(path);
  if (file.sha256 != proven)
    throw refuse(fmt::format("{}: is not the newest decision about the session in audit.jsonl", path.string()));
  if (!is_signed(file.json, key))
    throw refuse(fmt::format("{}: is not signed by the signing_key of the watch file", path.string()));
  try {
    return decision_from(file.json);
  } catch (const nlohmann::json::exception& error) {
    throw refuse(fmt::format("{}: is not a decision: {}", path.string(), error.what()));
  }
}

void put_decision(const fs::path& folder, const Decision& decision, AuditLog& audit,
                  const std::optional<SigningKey>& key) {
  nlohmann::ordered_json json = json_of(decision);
  json[kAuditHeadKey] = audit.head();
  sign(json, key);
  const std::string text = file_text(json);
  try {
    audit.append("decided", {{"session", decision.session},
                             {"decision", to_string(decision.kind)},
                             {"by", decision.by},
                             {"user", decision.user},
                             {"record", decision.record},
                             {"file", sha256_of(text)}});
  } catch (const Error& error) {
    throw Error(fmt::format("session {}: nothing is decided: {}", decision.session, error.what()));
  }
  replace_text(numbered(folder, decision.session, count_of(folder, decision.session) + 1), text);
}

}  // namespace isoshift
