#include "geometry/motion_axes.h"

#include "geometry/rotation.h"

namespace isoshift {

std::array<double, 6> components_of(const Eigen::Isometry3d& motion) {
  const ZxyAngles angles = zxy_from_rotation(motion.linear());
  return {motion.translation().x(),   motion.translation().y(),   motion.translation().z(),
          deg_from_rad(angles.x_rad), deg_from_rad(angles.y_rad), deg_from_rad(angles.z_rad)};
}

}  // namespace isoshift
