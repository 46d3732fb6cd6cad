#include "workflow/commission/known_poses.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/csv.h"
#include "base/error.h"
#include "base/sha256.h"
#include "base/text_file.h"
#include "geometry/motion_axes.h"
#include "geometry/rotation.h"
#include "io/dicom/table_read_outs.h"
#include "setup/setup_errors.h"

namespace isoshift {
namespace {

constexpr const char* kSession = "session";
constexpr double kMaxMm = 1000.0, kMaxDeg = 180.0;

double number_from(const std::string& text, const StatedColumn& column, double most, const std::string& where) {
  const auto value = number_in_cell(text);
  most /= column.unit;
  if (!value || std::abs(*value) > most)
    throw Error(fmt::format("{}, column {}: \"{}\", expected a number from {:g} to {:g}", where, column.name, text,
                            -most, most));
  return column.unit * *value;
}

Eigen::Isometry3d pose_of(const ErrorComponents& components) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(components.data());
  pose.linear() = rotation_from_zxy({.z_rad = rad_from_deg(components[5]),
                                     .x_rad = rad_from_deg(components[3]),
                                     .y_rad = rad_from_deg(components[4])});
  return pose;
}

// The table turns about the isocenter's vertical axis, and its translations turn with it (IEC 61217).
Eigen::Isometry3d room_from_table(const std::string& name, const SetupResult& session) {
  if (!session.table_position_mm)
    throw Error(fmt::format(
        "session {}: its X-rays do not say where the table stood (Table Top Lateral, Longitudinal and Vertical "
        "Position, (300A,012A), (300A,0129), (300A,0128)). Name the moves: --moves FILE.csv",
        name));
  return Eigen::AngleAxisd(session.table.yaw_rad(), Eigen::Vector3d::UnitZ()) *
         Eigen::Translation3d(*session.table_position_mm);
}

}  // namespace

KnownPoses read_known_poses(const std::filesystem::path& csv) {
  const std::string text = text_of_file(csv);
  const CsvTable table = csv_table(text, csv.string());
  const std::string all_columns = fmt::format("{}, {}", kSession, fmt::join(kErrorComponents, ", "));
  KnownPoses poses{.by_session = {}, .sha256 = sha256_of(text)};
  poses.columns = stated_columns(table, kErrorComponents, csv.string());
  const auto session_column = std::ranges::find(table.columns, kSession);
  for (const std::string& name : table.columns)
    if (name != kSession &&
        std::ranges::none_of(poses.columns, [&](const auto& one) { return one && one->name == name; }))
      throw Error(fmt::format("{}: column \"{}\", expected one of {} (or in cm and rad: x_cm, rx_rad)", csv.string(),
                              name, all_columns));
  const auto need = [&](bool is_there, const char* name) {
    if (!is_there)
      throw Error(fmt::format("{}: has no column {}; its first line must name the columns {}", csv.string(), name,
                              all_columns));
  };
  need(session_column != table.columns.end(), kSession);
  for (const std::size_t axis : {0, 1, 2}) need(poses.columns[axis].has_value(), kErrorComponents[axis]);
  poses.have_angles = poses.columns[3].has_value();
  for (const std::size_t axis : {3, 4, 5})
    if (poses.columns[axis].has_value() != poses.have_angles)
      throw Error(
          fmt::format("{}: has only some of the columns rx_deg, ry_deg, rz_deg, expected all or none", csv.string()));
  for (const CsvTable::Row& row : table.rows) {
    const std::string where = fmt::format("{}, line {}", csv.string(), row.line);
    const std::string& session = row.cells[static_cast<std::size_t>(session_column - table.columns.begin())];
    ErrorComponents components{};
    for (std::size_t n = 0; n < components.size(); ++n)
      if (const auto& column = poses.columns[n])
        components[n] = number_from(row.cells[column->place], *column, is_rotation(n) ? kMaxDeg : kMaxMm, where);
    if (!poses.by_session.emplace(session, pose_of(components)).second)
      throw Error(fmt::format("{}: session \"{}\" is there twice", where, session));
  }
  if (poses.by_session.empty()) throw Error(fmt::format("{}: names no session", csv.string()));
  return poses;
}

Eigen::Isometry3d moved_by_table(const std::string& before_name, const SetupResult& before, const std::string& now_name,
                                 const SetupResult& now) {
  const double most_rad = rad_from_deg(kMaxTableTurnDeg);
  for (const auto& [angle, difference_rad] :
       {std::pair("pitch", now.table.pitch_rad - before.table.pitch_rad),
        std::pair("roll", now.table.roll_rad - before.table.roll_rad),
        std::pair("eccentric angle", now.table.eccentric_rad - before.table.eccentric_rad)})
    if (std::abs(difference_rad) > most_rad)
      throw Error(
          fmt::format("session {}: the table's {} differs by {:.2f} degrees from that of session {}. Read-outs "
                      "do not say about which point it turned. Name the moves: --moves FILE.csv",
                      now_name, angle, deg_from_rad(difference_rad), before_name));
  return room_from_table(now_name, now) * room_from_table(before_name, before).inverse();
}

}  // namespace isoshift
