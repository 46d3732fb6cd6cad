#include "setup/shown_shift.h"

#include <algorithm>
#include <cmath>

#include "geometry/patient_setup.h"
#include "geometry/rotation.h"

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

std::vector<ShownShift::LeftOver> left_over(const SetupResult& result, const Eigen::Isometry3d& setup_error,
                                            const CouchShift& shift) {
  constexpr double kAlongPatientMm = 50.0;
  std::vector<SetupResult::Point> points = {{.name = "isocenter"}};
  if (const auto position = patient_position_from(result.patient_position)) {
    const Eigen::Vector3d superior =
        planned_room_from_patient(*position, result.table, Eigen::Vector3d::Zero()).linear() * Eigen::Vector3d::UnitZ();
    points.push_back({"50 mm superior", kAlongPatientMm * superior});
    points.push_back({"50 mm inferior", -kAlongPatientMm * superior});
  }
  if (result.target) points.push_back({result.target->name, result.target->center_room_mm});
  points.insert(points.end(), result.points.begin(), result.points.end());
  std::vector<ShownShift::LeftOver> left;
  left.reserve(points.size());
  for (const SetupResult::Point& point : points)
    left.push_back({point.name, left_over_mm(setup_error, result.table, shift, point.room_mm)});
  return left;
}

std::vector<ShownShift::Moved> moved_bodies(const SetupResult& result) {
  std::optional<Eigen::Matrix3d> patient_from_room;
  if (const auto position = patient_position_from(result.patient_position))
    patient_from_room =
        planned_room_from_patient(*position, result.table, Eigen::Vector3d::Zero()).linear().transpose();
  const auto in_patient = [&](const Eigen::Vector3d& vector) {
    return patient_from_room && vector.norm() > 0.0
               ? std::optional(Eigen::Vector3d(*patient_from_room * vector.normalized()))
               : std::nullopt;
  };
  const Eigen::Vector3d target = result.target ? result.target->center_room_mm : Eigen::Vector3d::Zero();
  std::vector<ShownShift::Moved> all;
  for (const BodyMotion& body : result.bodies) {
    ShownShift::Moved& moved = all.emplace_back();
    moved.name = body.name;
    moved.vertebra = body.vertebra;
    moved.from_target_mm = (body.center_room_mm - target).norm();
    moved.carries_target = body.carries_target;
    moved.breathes = body.breathes;
    moved.is_determined = body.is_determined();
    if (!moved.is_determined) continue;
    moved.mm = body.displacement_mm.norm();
    moved.two_sigma_mm = 2.0 * body.sigma_mm.maxCoeff();
    moved.deg = deg_from_rad(body.rotation_rad.norm());
    moved.direction_patient = in_patient(body.displacement_mm);
    moved.axis_patient = in_patient(body.rotation_rad);
  }
  std::ranges::stable_sort(all, {}, &ShownShift::Moved::from_target_mm);
  return all;
}

}  // namespace

Eigen::Isometry3d known_setup_error(Eigen::Isometry3d setup_error,
                                    const std::vector<Eigen::Vector3d>& unobservable_room) {
  for (const Eigen::Vector3d& direction : unobservable_room)
    setup_error.translation() -= direction.dot(setup_error.translation()) * direction;
  return setup_error;
}

ShownShift shown_shift(const SetupResult& result) {
  ShownShift shown;
  const Eigen::Isometry3d setup_error = known_setup_error(result);
  const CouchDof dof = result.site ? result.site->couch_dof : CouchDof::kSix;
  const Eigen::Vector3d target_mm = result.target ? result.target->center_room_mm : Eigen::Vector3d::Zero();
  const CouchShift shift = couch_shift_for(setup_error, result.table);
  const CouchShift applied = applicable_shift(setup_error, result.table, dof, target_mm);
  const ZxyAngles error = zxy_from_rotation(setup_error.linear());
  shown.setup_error_mm = determined(setup_error.translation(), result.unobservable_room);
  shown.setup_error_deg = {deg_from_rad(error.x_rad), deg_from_rad(error.y_rad), deg_from_rad(error.z_rad)};
  if (result.uncertainty) {
    shown.sigma_mm = determined(result.uncertainty->sigma_translation_mm(), result.unobservable_room);
    const Eigen::Vector3d sigma_rad = result.uncertainty->sigma_rotation_rad();
    for (int axis = 0; axis < 3 && !result.translation_only; ++axis)
      shown.sigma_deg[axis] = deg_from_rad(sigma_rad[axis]);
  }
  if (result.target) {
    shown.target_mm = determined(displacement_mm(setup_error, target_mm), result.unobservable_room);
    if (result.uncertainty)
      shown.target_sigma_mm =
          determined(result.uncertainty->sigma_at_mm(setup_error * target_mm), result.unobservable_room);
  }
  shown.withheld = result.verdict() == Verdict::kRejected;
  std::vector<Eigen::Vector3d> unobservable_table;
  unobservable_table.reserve(result.unobservable_room.size());
  for (const Eigen::Vector3d& direction : result.unobservable_room)
    unobservable_table.push_back(rotation_z(-result.table.yaw_rad()) * direction);
  shown.couch_mm = determined(shift.translation_mm, unobservable_table);
  shown.applied_mm = determined(applied.translation_mm, unobservable_table);
  shown.couch_deg = yaw_pitch_roll_deg(shift.change);
  shown.couch_target_deg = yaw_pitch_roll_deg(shift.target);
  if (result.uncertainty) {
    // Of the target, which the shift brings right. The table's axes are the room's turned about z.
    const Eigen::Matrix3d table_from_room = rotation_z(-result.table.yaw_rad());
    const Eigen::Vector3d variance =
        (table_from_room * result.uncertainty->covariance_at_mm2(setup_error * target_mm) * table_from_room.transpose())
            .diagonal();
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (shown.couch_mm[axis]) shown.couch_sigma_mm[axis] = std::sqrt(variance[static_cast<Eigen::Index>(axis)]);
  }
  if (!shown.withheld) shown.moved = moved_bodies(result);
  shown.can_rotate = {dof != CouchDof::kThree, dof == CouchDof::kSix, dof == CouchDof::kSix};
  if (!shown.withheld && result.unobservable_room.empty()) shown.left_over = left_over(result, setup_error, applied);
  if (!shown.withheld && result.site && result.site->level)
    shown.decision = decide_action(
        *result.site->level, shown.setup_error_mm,
        result.translation_only ? std::array<std::optional<double>, 3>()
                                : std::array<std::optional<double>, 3>(
                                      {shown.setup_error_deg[0], shown.setup_error_deg[1], shown.setup_error_deg[2]}));
  return shown;
}

std::array<std::optional<double>, 6> shown_components(const ShownShift& shown) {
  return {shown.setup_error_mm[0],  shown.setup_error_mm[1],  shown.setup_error_mm[2],
          shown.setup_error_deg[0], shown.setup_error_deg[1], shown.setup_error_deg[2]};
}

std::optional<ErrorComponents> complete_components(const ShownShift& shown) {
  const auto components = shown_components(shown);
  if (!std::ranges::all_of(components, [](const auto& component) { return component.has_value(); }))
    return std::nullopt;
  ErrorComponents complete{};
  std::ranges::transform(components, complete.begin(), [](const auto& component) { return *component; });
  return complete;
}

}  // namespace isoshift
