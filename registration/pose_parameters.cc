#include "registration/pose_parameters.h"

namespace isoshift {

Eigen::Isometry3d setup_error_from_parameters(std::span<const double> parameters) {
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  if (parameters.size() == 6) {
    const Eigen::Vector3d rotation = Eigen::Vector3d(parameters.data() + 3) / kLeverMm;
    if (const double angle_rad = rotation.norm(); angle_rad > 0.0)
      setup_error.linear() = Eigen::AngleAxisd(angle_rad, rotation / angle_rad).toRotationMatrix();
  }
  setup_error.translation() = Eigen::Vector3d(parameters.data());
  return setup_error;
}

PoseDistance distance_between(std::span<const double> parameters, std::span<const double> other) {
  const Eigen::Isometry3d a = setup_error_from_parameters(parameters), b = setup_error_from_parameters(other);
  return {.translation_mm = (a.translation() - b.translation()).norm(),
          .angle_rad = Eigen::AngleAxisd(a.linear() * b.linear().transpose()).angle()};
}

}  // namespace isoshift
