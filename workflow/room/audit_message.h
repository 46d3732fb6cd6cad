#pragma once
// Lines of the audit log as DICOM audit messages (PS3.15 A.5), where A.5.3 defines one for the event.

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "setup/identity.h"

namespace isoshift {

// What a message says beside its line.
struct AuditContext {
  std::string site;              // AuditSourceID
  Identity identity;             // of the session's patient and study
  std::string called_aet, host;  // of the peer that received an object
};

// Whether A.5.3 defines a message for the line's event.
bool has_audit_message(const nlohmann::ordered_json& line);

// One line of XML; nothing for an event that A.5.3 does not define:
//
//   started, stopped              Application Activity (A.5.3.1)
//   viewed, opened by hand, deleted
//                                 DICOM Instances Accessed (A.5.3.6)
//   sent                          DICOM Instances Transferred (A.5.3.7)
//   signed in, sign-in refused    User Authentication (A.5.3.12)
//
// Unlike the log itself it names the patient's ID and study, as A.5.3 demands, and never the patient's name.
std::optional<std::string> audit_message(const nlohmann::ordered_json& line, const AuditContext& context);

}  // namespace isoshift
