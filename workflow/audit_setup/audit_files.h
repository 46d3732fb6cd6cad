#pragma once
// The files of an audit: audit.csv, audit.json and audit.html.

#include <filesystem>
#include <string>

#include "workflow/audit_setup/setup_audit.h"

namespace isoshift {

std::string audit_json(const SetupAudit& audit);

// `place`: the folder in which the file will lie; reports are linked relative to it.
std::string audit_csv(const SetupAudit& audit, const std::filesystem::path& place);
std::string audit_html(const SetupAudit& audit, const std::filesystem::path& place);

// Writes all three. `used`: where the used shifts were read; may be empty. Throws Error as OutputFolder does.
void write_audit(const SetupAudit& audit, const std::filesystem::path& used, const std::filesystem::path& folder,
                 bool overwrite);

}  // namespace isoshift
