#include "setup/target.h"

namespace isoshift {

Eigen::Vector3d displacement_mm(const Eigen::Isometry3d& setup_error, const Eigen::Vector3d& point_room_mm) {
  return setup_error * point_room_mm - point_room_mm;
}

Eigen::Vector3d displacement_sigma_mm(const Uncertainty& uncertainty, const Eigen::Vector3d& point_room_mm) {
  Eigen::Matrix3d lever;  // the cross product with the point
  lever << 0.0, -point_room_mm.z(), point_room_mm.y(), point_room_mm.z(), 0.0, -point_room_mm.x(), -point_room_mm.y(),
      point_room_mm.x(), 0.0;
  const Eigen::Vector3d variance =
      uncertainty.translation_mm.cwiseAbs2() + lever.cwiseAbs2() * uncertainty.rotation_rad.cwiseAbs2().eval();
  return variance.cwiseSqrt();
}

}  // namespace isoshift
