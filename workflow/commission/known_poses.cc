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
#include "geometry/rotation.h"
#include "io/dicom/table_read_outs.h"
#include "setup/setup_errors.h"

namespace isoshift {
namespace {

constexpr const char* kSession = "session";
constexpr double kMaxMm = 1000.0, kMaxDeg = 180.0;

double number_from(const std::string& text, const char* column, const std::string& where) {
  const auto value = number_in_cell(text);
  const double most = std::string_view(column).ends_with("_deg") ? kMaxDeg : kMaxMm;
  if (!value || std::abs(*value) > most)
    throw Error(
        fmt::format("{}, column {}: \"{}\", expected a number from {:g} to {:g}", where, column, text, -most, most));
  return *value;
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
  const auto is_known = [](const std::string& name) {
    return name == kSession || std::ranges::find(kErrorComponents, name) != kErrorComponents.end();
  };
  for (const std::string& name : table.columns)
    if (!is_known(name))
      throw Error(fmt::format("{}: column \"{}\", expected one of {}", csv.string(), name, all_columns));
  const auto column_of = [&](std::string_view name) { return std::ranges::find(table.columns, name); };
  const auto has = [&](std::string_view name) { return column_of(name) != table.columns.end(); };
  for (const char* name : {kSession, "x_mm", "y_mm", "z_mm"})
    if (!has(name))
      throw Error(fmt::format("{}: has no column {}; its first line must name the columns {}", csv.string(), name,
                              all_columns));
  KnownPoses poses{.by_session = {}, .have_angles = has("rx_deg"), .sha256 = sha256_of(text)};
  for (const char* name : {"rx_deg", "ry_deg", "rz_deg"})
    if (has(name) != poses.have_angles)
      throw Error(
          fmt::format("{}: has only some of the columns rx_deg, ry_deg, rz_deg, expected all or none", csv.string()));
  for (const CsvTable::Row& row : table.rows) {
    const std::string where = fmt::format("{}, line {}", csv.string(), row.line);
    const auto cell = [&](auto column) { return row.cells[static_cast<std::size_t>(column - table.columns.begin())]; };
    ErrorComponents components{};
    for (std::size_t n = 0; n < components.size(); ++n)
      if (has(kErrorComponents[n]))
        components[n] = number_from(cell(column_of(kErrorComponents[n])), kErrorComponents[n], where);
    if (!poses.by_session.emplace(cell(column_of(kSession)), pose_of(components)).second)
      throw Error(fmt::format("{}: session \"{}\" is there twice", where, cell(column_of(kSession))));
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
