#pragma once
// What people say about a session, in files NAME.1.json, NAME.2.json and so on, of which the newest counts. Each file
// is signed by the key of the watch file, and the audit log has a line with its SHA-256.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/signing_key.h"
#include "workflow/room/audit_log.h"

namespace isoshift {

struct StatementKind {
  const char* event;   // of the lines in the audit log
  const char* folder;  // in the results tree
  const char* name;
  const char* consequence;  // of a file that the audit log or the key does not prove
};
inline constexpr StatementKind kDecisionStatement{
    "decided", "decided", "decision",
    "Nothing of the session is released or sent until a person takes it back or decides against the result"};
inline constexpr StatementKind kChoiceStatement{"chosen", "chosen", "choice",
                                                "The choice does not count until a person chooses again"};
inline constexpr StatementKind kHandOverStatement{
    "handed over", "handed_over", "result by hand",
    "Nothing of the session is released or sent until a person moves the folder in handed_over away"};

// The newest statement about a session; nothing if there is none. `results`: the results tree. Throws Error if the
// files do not say what the audit log proves.
std::optional<nlohmann::json> newest_statement(const StatementKind& kind, const std::filesystem::path& results,
                                               const std::string& session, const AuditLog& audit,
                                               const std::optional<SigningKey>& key);

// `line`: what the audit log says of the statement, without names of patients and without UIDs. Throws Error, and
// states nothing, if the audit log cannot be written.
void put_statement(const StatementKind& kind, const std::filesystem::path& results, const std::string& session,
                   nlohmann::ordered_json statement, nlohmann::ordered_json line, AuditLog& audit,
                   const std::optional<SigningKey>& key);

}  // namespace isoshift
