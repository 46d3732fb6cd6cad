#include "io/dicom/table_read_outs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/rotation.h"

namespace isoshift {

const std::vector<TableReadOut>& table_read_outs() {
  static const std::vector<TableReadOut> all = {
      {&TableReadOuts::lateral_mm, DCM_TableTopLateralPosition, false},
      {&TableReadOuts::longitudinal_mm, DCM_TableTopLongitudinalPosition, false},
      {&TableReadOuts::vertical_mm, DCM_TableTopVerticalPosition, false},
      {&TableReadOuts::support_angle_deg, DCM_PatientSupportAngle, true},
      {&TableReadOuts::eccentric_angle_deg, DCM_TableTopEccentricAngle, true},
      {&TableReadOuts::pitch_deg, DCM_TableTopPitchAngle, true},
      {&TableReadOuts::roll_deg, DCM_TableTopRollAngle, true},
  };
  return all;
}

bool TableReadOuts::has_position() const {
  constexpr double kFarthestMm = 3000.0, kZeroMm = 0.01;
  int zeros = 0;
  for (const auto& position_mm : {lateral_mm, longitudinal_mm, vertical_mm}) {
    if (!position_mm || std::abs(*position_mm) > kFarthestMm) return false;
    zeros += std::abs(*position_mm) < kZeroMm ? 1 : 0;
  }
  return zeros < 2;
}

bool TableReadOuts::has_same_read_outs(const TableReadOuts& other) const {
  return std::ranges::all_of(table_read_outs(), [&](const TableReadOut& read_out) {
    return (this->*read_out.value).has_value() == (other.*read_out.value).has_value();
  });
}

TableReadOuts read_table_read_outs(const std::function<std::optional<double>(const TableReadOut&)>& value_of,
                                   const std::optional<std::string>& origin) {
  TableReadOuts table{.are_measured = origin == "ACTUAL"};
  for (const TableReadOut& read_out : table_read_outs()) table.*read_out.value = value_of(read_out);
  return table;
}

std::optional<std::string> table_change(const TableReadOut& read_out, const TableReadOuts& now,
                                        const TableReadOuts& before) {
  if (!(now.*read_out.value) || !(before.*read_out.value)) return std::nullopt;
  const double change = *(now.*read_out.value) - *(before.*read_out.value);
  if (!read_out.is_angle) {
    if (std::abs(change) <= kMaxTableMoveMm) return std::nullopt;
    return fmt::format("moved by {:.1f} mm", change);
  }
  const double turned_deg = deg_from_rad(wrapped_rad(rad_from_deg(change)));
  if (std::abs(turned_deg) <= kMaxTableTurnDeg) return std::nullopt;
  return fmt::format("turned by {:.1f} degrees", turned_deg);
}

bool has_table_moved(const TableReadOuts& now, const TableReadOuts& before) {
  return std::ranges::any_of(
      table_read_outs(), [&](const TableReadOut& read_out) { return table_change(read_out, now, before).has_value(); });
}

}  // namespace isoshift
