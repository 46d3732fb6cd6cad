#include "io/report/setup_report.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

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

std::vector<ShownShift::LeftOver> left_over(const SetupReport& report, const Eigen::Isometry3d& setup_error,
                                            const CouchShift& shift) {
  constexpr double kAlongPatientMm = 50.0;
  std::vector<SetupReport::Point> points = {{.name = "isocenter"}};
  if (const auto position = patient_position_from(report.patient_position)) {
    const Eigen::Vector3d superior =
        planned_room_from_patient(*position, report.table, Eigen::Vector3d::Zero()).linear() * Eigen::Vector3d::UnitZ();
    points.push_back({"50 mm superior", kAlongPatientMm * superior});
    points.push_back({"50 mm inferior", -kAlongPatientMm * superior});
  }
  points.insert(points.end(), report.points.begin(), report.points.end());
  std::vector<ShownShift::LeftOver> result;
  result.reserve(points.size());
  for (const SetupReport::Point& point : points)
    result.push_back({point.name, left_over_mm(setup_error, report.table, shift, point.room_mm)});
  return result;
}

// By the setup error as it is, before any rounding.
void judge_action(const ActionLevel& level, bool translation_only, ShownShift& shown) {
  bool is_known = true;
  const auto compare = [&](const std::string& what, std::span<const std::optional<double>> values,
                           const std::optional<double>& limit, const char* unit) {
    if (!limit) return;
    constexpr std::array kAxes = {"x", "y", "z"};
    std::vector<std::string> beyond;
    for (std::size_t n = 0; n < values.size(); ++n) {
      is_known = is_known && values[n].has_value();
      if (values[n] && std::abs(*values[n]) > *limit) beyond.emplace_back(values.size() == 1 ? "" : kAxes[n]);
    }
    if (!beyond.empty())
      shown.action_reasons.push_back(fmt::format("{}{}: more than {} {}", what, fmt::join(beyond, ", "), *limit, unit));
  };
  // Of the length, what is known of it is the least it can be.
  double square_mm = 0.0;
  bool has_all = true;
  for (const std::optional<double>& component : shown.setup_error_mm) {
    square_mm += component.value_or(0.0) * component.value_or(0.0);
    has_all = has_all && component;
  }
  const bool is_long = level.vector_mm && std::sqrt(square_mm) > *level.vector_mm;
  const std::array length = {has_all || is_long ? std::optional(std::sqrt(square_mm)) : std::nullopt};
  std::array<std::optional<double>, 3> rotation_deg;
  if (!translation_only) std::ranges::copy(shown.setup_error_deg, rotation_deg.begin());
  compare("setup error along ", shown.setup_error_mm, level.translation_mm, "mm");
  compare("length of the translation", length, level.vector_mm, "mm");
  compare("setup error about ", rotation_deg, level.rotation_deg, "deg");
  shown.action = !shown.action_reasons.empty() ? Action::kExceeds : is_known ? Action::kWithin : Action::kUnset;
}

}  // namespace

std::string_view to_string(Action action) {
  switch (action) {
    case Action::kUnset: return "unset";
    case Action::kWithin: return "within";
    case Action::kExceeds: return "exceeds";
  }
  return "";
}

Eigen::Isometry3d known_setup_error(const SetupReport& report) {
  Eigen::Isometry3d known = report.setup_error;
  for (const Eigen::Vector3d& direction : report.unobservable_room)
    known.translation() -= direction.dot(known.translation()) * direction;
  return known;
}

ShownShift shown_shift(const SetupReport& report) {
  ShownShift shown;
  const Eigen::Isometry3d setup_error = known_setup_error(report);
  const CouchShift shift = couch_shift_for(setup_error, report.table);
  const ZxyAngles error = zxy_from_rotation(setup_error.linear());
  shown.setup_error_mm = determined(setup_error.translation(), report.unobservable_room);
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
  if (report.sigma) {
    // The table's axes are the room's turned about z. Correlations between axes are left out.
    const Eigen::Matrix3d table_from_room = rotation_z(-report.table.yaw_rad());
    const Eigen::Vector3d variance = table_from_room.cwiseAbs2() * report.sigma->translation_mm.cwiseAbs2().eval();
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (shown.couch_mm[axis]) shown.couch_sigma_mm[axis] = std::sqrt(variance[static_cast<Eigen::Index>(axis)]);
  }
  const CouchDof dof = report.site ? report.site->couch_dof : CouchDof::kSix;
  shown.can_rotate = {dof != CouchDof::kThree, dof == CouchDof::kSix, dof == CouchDof::kSix};
  if (!shown.withheld && report.unobservable_room.empty())
    shown.left_over = left_over(report, setup_error, applicable(shift, report.table, dof));
  if (!shown.withheld && report.site && report.site->level)
    judge_action(*report.site->level, report.translation_only, shown);
  return shown;
}

}  // namespace isoshift
