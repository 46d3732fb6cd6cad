#include "setup/target.h"

#include "geometry/rotation.h"

namespace isoshift {

Eigen::Vector3d displacement_mm(const Eigen::Isometry3d& setup_error, const Eigen::Vector3d& point_room_mm) {
  return setup_error * point_room_mm - point_room_mm;
}

Eigen::Vector3d displacement_sigma_mm(const Uncertainty& uncertainty, const Eigen::Vector3d& point_room_mm) {
  const Eigen::Vector3d variance =
      uncertainty.translation_mm.cwiseAbs2() +
      cross_matrix(point_room_mm).cwiseAbs2() * uncertainty.rotation_rad.cwiseAbs2().eval();
  return variance.cwiseSqrt();
}

}  // namespace isoshift
