#pragma once
// The couch shifts that a clinic used: a table (CSV), or a folder of Spatial Registration objects of any program.

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "workflow/audit_setup/audited_session.h"

namespace isoshift {

// The table's first line: session,lateral_mm,longitudinal_mm,vertical_mm,yaw_deg,pitch_deg,roll_deg.
std::string used_shifts_header();

// Fills in what the table says of sessions; returns the SHA-256 of the file. An empty cell is not known, nor
// is a column that is not there. Columns may stand in any order, and be in cm and rad. Throws Error naming line and
// column for another header, a cell that is no finite number, a session that is there twice or that the archive does
// not have, and as check_columns() does.
std::string read_used_table(const std::filesystem::path& table, std::vector<AuditedSession>& sessions);

// Fills in what the objects in a folder mean as couch shifts: an object belongs to the session of which it names an
// X-ray. `source_isocenter_mm` says where the machine's isocenter lies in frames of other programs (docs/commands/
// check.md). Returns a line for every file that is of no use, with the reason. Throws Error for a folder that holds no
// Spatial Registration.
std::vector<std::string> read_used_objects(const std::filesystem::path& folder,
                                           const std::optional<Eigen::Vector3d>& source_isocenter_mm,
                                           std::vector<AuditedSession>& sessions);

}  // namespace isoshift
