#pragma once
// Right-handed rotations and the one angle order of isoshift, Rz * Rx * Ry (IEC 61217 table: support, pitch, roll).

#include <Eigen/Geometry>
#include <numbers>
#include <optional>

namespace isoshift {

constexpr double rad_from_deg(double deg) { return deg * std::numbers::pi / 180.0; }
constexpr double deg_from_rad(double rad) { return rad * 180.0 / std::numbers::pi; }

// The same angle in (-pi, pi].
double wrapped_rad(double angle_rad);

// The matrix of the cross product: cross_matrix(v) * x is v x x.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v);

// How a place moves with small motions: by translation, and by rotation about the origin (a rotation vector, in rad).
Eigen::Matrix<double, 3, 6> place_per_motion(const Eigen::Vector3d& place);

Eigen::Matrix3d rotation_x(double angle_rad);
Eigen::Matrix3d rotation_y(double angle_rad);
Eigen::Matrix3d rotation_z(double angle_rad);

// The angle times the unit axis, and back.
Eigen::Vector3d rotation_vector(const Eigen::Matrix3d& rotation);
Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector);

// Angles of R = Rz(z_rad) * Rx(x_rad) * Ry(y_rad). For a couch: z is yaw, x is pitch, y is roll.
struct ZxyAngles {
  double z_rad = 0.0;
  double x_rad = 0.0;
  double y_rad = 0.0;
};

Eigen::Matrix3d rotation_from_zxy(const ZxyAngles& angles);

// The inverse of rotation_from_zxy(): x within [-pi/2, pi/2], z and y within (-pi, pi].
ZxyAngles zxy_from_rotation(const Eigen::Matrix3d& rotation);

// How far the entries of R'R may lie from those of the identity, since the numbers of a stored rotation R are rounded.
inline constexpr double kRigidTolerance = 1e-4;

// A matrix as a rigid motion; nothing if it is none.
std::optional<Eigen::Isometry3d> as_rigid(const Eigen::Affine3d& matrix);

}  // namespace isoshift
