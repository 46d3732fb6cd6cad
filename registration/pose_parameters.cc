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

}  // namespace isoshift
