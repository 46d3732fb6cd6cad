#pragma once
// The folder decided/ of a results tree: SESSION.N.json is the N-th decision about a session. It counts with its line
// in the audit log, which has the SHA-256 of the file and not the reason: a person may have named the patient.

#include <filesystem>
#include <optional>
#include <string>

#include "base/signing_key.h"
#include "workflow/room/audit_log.h"
#include "workflow/room/decision.h"

namespace isoshift {

// The newest decision about a session; nothing if there is none. Throws Error if the newest file is not the newest
// decision in the audit log, or is not signed by the key, if there is one.
std::optional<Decision> newest_decision(const std::filesystem::path& folder, const std::string& session,
                                        const AuditLog& audit, const std::optional<SigningKey>& key);

// First the line in the audit log, then the file. A process that is killed between the two leaves a line that
// newest_decision() misses its file for, until somebody decides again. Throws Error if either cannot be written.
// The caller must hold the lock of releases.
void put_decision(const std::filesystem::path& folder, const Decision& decision, AuditLog& audit,
                  const std::optional<SigningKey>& key);

}  // namespace isoshift
