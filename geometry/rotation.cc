#include "geometry/rotation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace isoshift {

double wrapped_rad(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * std::numbers::pi);
  return wrapped <= -std::numbers::pi ? std::numbers::pi : wrapped;
}

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  return (Eigen::Matrix3d() << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0).finished();
}

Eigen::Matrix<double, 3, 6> place_per_motion(const Eigen::Vector3d& place) {
  return (Eigen::Matrix<double, 3, 6>() << Eigen::Matrix3d::Identity(), -cross_matrix(place)).finished();
}

Eigen::Matrix3d rotation_x(double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitX()).toRotationMatrix();
}

Eigen::Matrix3d rotation_y(double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitY()).toRotationMatrix();
}

Eigen::Matrix3d rotation_z(double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
}

Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector) {
  const double angle_rad = vector.norm();
  if (!(angle_rad > 0.0)) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle_rad, vector / angle_rad).toRotationMatrix();
}

Eigen::Matrix3d rotation_from_zxy(const ZxyAngles& angles) {
  return rotation_z(angles.z_rad) * rotation_x(angles.x_rad) * rotation_y(angles.y_rad);
}

ZxyAngles zxy_from_rotation(const Eigen::Matrix3d& rotation) {
  // Row 2 of Rz Rx Ry is (-cos x sin y, sin x, cos x cos y); column 1 is (-sin z cos x, cos z cos x, sin x).
  // x from atan2 and not asin, which loses half its digits near 90 degrees.
  return {.z_rad = std::atan2(-rotation(0, 1), rotation(1, 1)),
          .x_rad = std::atan2(rotation(2, 1), std::hypot(rotation(2, 0), rotation(2, 2))),
          .y_rad = std::atan2(-rotation(2, 0), rotation(2, 2))};
}

std::optional<Eigen::Isometry3d> as_rigid(const Eigen::Affine3d& matrix) {
  const Eigen::Matrix3d r = matrix.linear();
  if (!((r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kRigidTolerance) ||
      r.determinant() < 0.0 || matrix.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    return std::nullopt;
  return Eigen::Isometry3d(matrix.matrix());
}

}  // namespace isoshift
