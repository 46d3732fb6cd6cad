#include "setup/couch_shift.h"

namespace isoshift {

Eigen::Isometry3d setup_error_from_poses(const Eigen::Isometry3d& planned_room_from_patient,
                                         const Eigen::Isometry3d& actual_room_from_patient) {
  return actual_room_from_patient * planned_room_from_patient.inverse();
}

CouchShift couch_shift_for(const Eigen::Isometry3d& setup_error, const TableAngles& table,
                           const Eigen::Vector3d& about_mm) {
  CouchShift shift;
  // The table top translates along axes that turn with support and eccentric angle, but not with pitch and roll.
  shift.translation_mm = rotation_z(-table.yaw_rad()) * (about_mm - setup_error * about_mm);
  shift.target = zxy_from_rotation(setup_error.linear().transpose() * rotation_from_zxy(table.zxy()));
  shift.change = {.z_rad = wrapped_rad(shift.target.z_rad - table.yaw_rad()),
                  .x_rad = wrapped_rad(shift.target.x_rad - table.pitch_rad),
                  .y_rad = wrapped_rad(shift.target.y_rad - table.roll_rad)};
  return shift;
}

Eigen::Vector3d translation_after_rotation_mm(const Eigen::Isometry3d& setup_error, const TableAngles& table) {
  return rotation_z(-table.yaw_rad()) * setup_error.inverse().translation();
}

CouchShift applicable_shift(const Eigen::Isometry3d& setup_error, const TableAngles& table, CouchDof dof,
                            const Eigen::Vector3d& point_mm) {
  CouchShift part = couch_shift_for(setup_error, table);
  if (dof == CouchDof::kSix) return part;
  part.change.x_rad = part.change.y_rad = 0.0;
  part.target.x_rad = table.pitch_rad;
  part.target.y_rad = table.roll_rad;
  if (dof == CouchDof::kThree) {
    part.change.z_rad = 0.0;
    part.target.z_rad = wrapped_rad(table.yaw_rad());
  }
  // left_over_mm() at the point, taken back through the rotation of the couch and along the table top's axes.
  const Eigen::Matrix3d room_from_table_turn =
      rotation_from_zxy(part.target) * rotation_from_zxy(table.zxy()).transpose();
  const Eigen::Vector3d left = left_over_mm(setup_error, table, part, point_mm);
  part.translation_mm -= rotation_z(-table.yaw_rad()) * (room_from_table_turn.transpose() * left);
  return part;
}

Eigen::Vector3d left_over_mm(const Eigen::Isometry3d& setup_error, const TableAngles& table, const CouchShift& shift,
                             const Eigen::Vector3d& point_mm) {
  const Eigen::Vector3d translated = setup_error * point_mm + rotation_z(table.yaw_rad()) * shift.translation_mm;
  return rotation_from_zxy(shift.target) * rotation_from_zxy(table.zxy()).transpose() * translated - point_mm;
}

}  // namespace isoshift
