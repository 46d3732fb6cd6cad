#pragma once
// Where a target was at a moment.

#include <Eigen/Core>

namespace isoshift {

struct MotionSample {
  double time_s = 0.0;
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
};

}  // namespace isoshift
