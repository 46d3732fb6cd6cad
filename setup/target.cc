#include "setup/target.h"

namespace isoshift {

Eigen::Vector3d displacement_mm(const Eigen::Isometry3d& setup_error, const Eigen::Vector3d& point_room_mm) {
  return setup_error * point_room_mm - point_room_mm;
}

}  // namespace isoshift
