#include "workflow/room/statement_files.h"

#include <fmt/format.h>

#include <utility>

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

std::optional<nlohmann::json> newest_statement(const StatementKind& kind, const fs::path& results,
                                               const std::string& session, const AuditLog& audit,
                                               const std::optional<SigningKey>& key) {
  const fs::path folder = results / kind.folder;
  const int count = count_of(folder, session);
  const std::string proven = audit.newest_statement(kind.event, session);
  if (count == 0 && proven.empty()) return std::nullopt;
  const fs::path path = numbered(folder, session, count);
  const auto refuse = [&](const std::string& why) -> Error {
    return Error(fmt::format("session {}: {}. {}", session, why, kind.consequence));
  };
  if (count == 0)
    throw refuse(fmt::format("audit.jsonl tells of a {} that {} does not hold", kind.name, folder.string()));
  JsonFile file = read_json_file(path);
  if (file.sha256 != proven)
    throw refuse(fmt::format("{}: is not the newest {} about the session in audit.jsonl", path.string(), kind.name));
  if (!is_signed(file.json, key))
    throw refuse(fmt::format("{}: is not signed by the signing_key of the watch file", path.string()));
  return std::move(file.json);
}

void put_statement(const StatementKind& kind, const fs::path& results, const std::string& session,
                   nlohmann::ordered_json statement, nlohmann::ordered_json line, AuditLog& audit,
                   const std::optional<SigningKey>& key) {
  statement[kAuditHeadKey] = audit.head();
  sign(statement, key);
  const std::string text = file_text(statement);
  line["file"] = sha256_of(text);
  try {
    audit.append(kind.event, line);
  } catch (const Error& error) {
    throw Error(fmt::format("session {}: nothing is {}: {}", session, kind.event, error.what()));
  }
  const fs::path folder = results / kind.folder;
  replace_text(numbered(folder, session, count_of(folder, session) + 1), text);
}

}  // namespace isoshift
