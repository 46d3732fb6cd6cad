#include "io/report/setup_report.h"

#include <fmt/format.h>

#include <cmath>

namespace isoshift {
namespace {

// A component is not determined where an unobservable direction enters it by more than this (docs/conventions.md).
constexpr double kMaxUnobservableShare = 0.05;

std::array<std::optional<double>, 3> determined(const Eigen::Vector3d& vector,
                                                const std::vector<Eigen::Vector3d>& unobservable) {
  std::array<std::optional<double>, 3> components;
  for (int axis = 0; axis < 3; ++axis) {
    bool known = true;
    for (const Eigen::Vector3d& direction : unobservable)
      known = known && std::abs(direction[axis]) <= kMaxUnobservableShare;
    if (known) components[axis] = vector[axis];
  }
  return components;
}

std::array<double, 3> yaw_pitch_roll_deg(const ZxyAngles& angles) {
  return {deg_from_rad(angles.z_rad), deg_from_rad(angles.x_rad), deg_from_rad(angles.y_rad)};
}

}  // namespace

ShownShift shown_shift(const SetupReport& report) {
  ShownShift shown;
  const CouchShift shift = couch_shift_for(report.setup_error, report.table);
  const ZxyAngles error = zxy_from_rotation(report.setup_error.linear());
  shown.setup_error_mm = determined(report.setup_error.translation(), report.unobservable_room);
  shown.setup_error_deg = {deg_from_rad(error.x_rad), deg_from_rad(error.y_rad), deg_from_rad(error.z_rad)};
  if (report.sigma) {
    shown.sigma_mm = determined(report.sigma->translation_mm, report.unobservable_room);
    for (int axis = 0; axis < 3 && !report.translation_only; ++axis)
      shown.sigma_deg[axis] = report.sigma->rotation_deg[axis];
  }
  shown.withheld = report.verdict == Verdict::kRejected;
  std::vector<Eigen::Vector3d> unobservable_table;
  for (const Eigen::Vector3d& direction : report.unobservable_room)
    unobservable_table.push_back(rotation_z(-report.table.yaw_rad()) * direction);
  shown.couch_mm = determined(shift.translation_mm, unobservable_table);
  shown.couch_deg = yaw_pitch_roll_deg(shift.change);
  shown.couch_target_deg = yaw_pitch_roll_deg(shift.target);
  return shown;
}

std::string rounded(double value) {
  const double tenths = std::round(value * 10.0);
  if (tenths == 0.0) return "0.0";
  return fmt::format("{:+.1f}", tenths / 10.0);
}

std::string rounded_up(double value) { return fmt::format("{:.1f}", std::ceil(value * 10.0 - 1e-9) / 10.0); }

}  // namespace isoshift
