#include "geometry/seen_motions.h"

#include <Eigen/Geometry>

namespace isoshift {

SeenMotions seen_motions(const Projection& projection, std::span<const Eigen::Vector3d> points_room_mm) {
  constexpr double kStep = 1e-3;
  SeenMotions motions = SeenMotions::Zero(static_cast<Eigen::Index>(2 * points_room_mm.size()), 6);
  for (std::size_t n = 0; n < points_room_mm.size(); ++n)
    for (int axis = 0; axis < 6; ++axis) {
      const Eigen::Vector3d& point = points_room_mm[n];
      const Eigen::Vector3d way =
          axis < 3 ? Eigen::Vector3d(Eigen::Vector3d::Unit(axis)) : Eigen::Vector3d::Unit(axis - 3).cross(point);
      const auto here = projection(point), there = projection(point + kStep * way);
      if (here && there) motions.block<2, 1>(static_cast<Eigen::Index>(2 * n), axis) = (*there - *here) / kStep;
    }
  return motions;
}

SeenMotions seen_motions(const XrayView& view, std::span<const Eigen::Vector3d> points_room_mm) {
  return seen_motions([&](const Eigen::Vector3d& point) { return view.project(point); }, points_room_mm);
}

}  // namespace isoshift
