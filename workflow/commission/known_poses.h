#pragma once
// Where a phantom is known to have lain: a table by people, or the read-outs of the treatment table.

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <string>

#include "setup/setup_result.h"
#include "workflow/stated_columns.h"

namespace isoshift {

// What is known of the phantom.
enum class Known {
  kReadOuts,   // how the table moved it, by the table's own read-outs
  kMoves,      // how it was moved between the sessions, by a table of people
  kPositions,  // where it lay in every session
};

struct KnownPoses {
  // The pose as a setup error (IEC 61217 fixed): what was planned at x lies at the pose times x. Of moves only the
  // differences between sessions are known.
  std::map<std::string, Eigen::Isometry3d> by_session;
  bool have_angles = true;  // otherwise rotations are unknown, and nothing is turned in the poses
  std::string sha256;       // of the table
  std::array<std::optional<StatedColumn>, 6> columns = {};
};

// CSV with the columns session, x_mm, y_mm, z_mm, rx_deg, ry_deg, rz_deg, in any order: R x + t, R = Rz Rx Ry. The
// columns of angles may be missing, all three of them. Columns may be in cm and rad. Throws Error naming line and
// column.
KnownPoses read_known_poses(const std::filesystem::path& csv);

// How the table had moved an object that lies on it from session `before` to `now`: motion of the room. Throws Error
// naming the session whose X-rays lack the table's position, and for a table that pitched, rolled or turned about its
// eccentric axis between the two, since read-outs do not say about which point.
Eigen::Isometry3d moved_by_table(const std::string& before_name, const SetupResult& before, const std::string& now_name,
                                 const SetupResult& now);

}  // namespace isoshift
