#include "registration/pose_parameters.h"

#include <cmath>

#include "geometry/rotation.h"

namespace isoshift {
namespace {

// How a rotation vector's change turns what it has turned already.
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  const Eigen::Matrix3d cross = cross_matrix(rotation_vector);
  constexpr double kSmall = 1e-4;  // below this the series' first terms are exact in double
  const double a = angle > kSmall ? (1.0 - std::cos(angle)) / (angle * angle) : 0.5;
  const double b = angle > kSmall ? (angle - std::sin(angle)) / (angle * angle * angle) : 1.0 / 6.0;
  return Eigen::Matrix3d::Identity() + a * cross + b * cross * cross;
}

}  // namespace

Eigen::Isometry3d setup_error_from_parameters(std::span<const double> parameters) {
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  if (parameters.size() == 6)
    setup_error.linear() = rotation_from_vector(Eigen::Vector3d(parameters.data() + 3) / kLeverMm);
  setup_error.translation() = Eigen::Vector3d(parameters.data());
  return setup_error;
}

std::vector<double> parameters_from_setup_error(const Eigen::Isometry3d& setup_error) {
  const Eigen::Vector3d t = setup_error.translation(), r = kLeverMm * rotation_vector(setup_error.linear());
  return {t.x(), t.y(), t.z(), r.x(), r.y(), r.z()};
}

Eigen::Matrix<double, 6, Eigen::Dynamic> motions_per_parameter(std::span<const double> parameters) {
  const auto count = static_cast<Eigen::Index>(parameters.size());
  Eigen::Matrix<double, 6, Eigen::Dynamic> motions = Eigen::MatrixXd::Identity(6, count);
  if (count < 6) return motions;
  const Eigen::Vector3d translation(parameters.data()), rotation = Eigen::Vector3d(parameters.data() + 3) / kLeverMm;
  const Eigen::Matrix3d turns = left_jacobian(rotation) / kLeverMm;
  motions.bottomRightCorner<3, 3>() = turns;
  motions.topRightCorner<3, 3>() = cross_matrix(translation) * turns;  // the translation is not turned with it
  return motions;
}

PoseDistance distance_between(std::span<const double> parameters, std::span<const double> other) {
  const Eigen::Isometry3d a = setup_error_from_parameters(parameters), b = setup_error_from_parameters(other);
  return {.translation_mm = (a.translation() - b.translation()).norm(),
          .angle_rad = Eigen::AngleAxisd(a.linear() * b.linear().transpose()).angle()};
}

}  // namespace isoshift
