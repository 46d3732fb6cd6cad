#pragma once
// EXPECT_THAT(found, PoseNear(truth, max_mm, max_deg)): rigid motions about the origin that agree.

#include <gmock/gmock.h>

#include <Eigen/Geometry>

#include <ostream>

#include "geometry/rotation.h"

namespace Eigen {

// gtest would print the bytes.
inline void PrintTo(const Isometry3d& pose, std::ostream* out) { *out << "\n" << pose.matrix() << "\n"; }

}  // namespace Eigen

namespace isoshift {

MATCHER_P3(PoseNear, truth, max_mm, max_deg, "") {
  const Eigen::Isometry3d expected = truth;
  const double off_mm = (arg.translation() - expected.translation()).norm();
  const double off_deg = deg_from_rad(Eigen::AngleAxisd(arg.linear() * expected.linear().transpose()).angle());
  *result_listener << "off by " << off_mm << " mm and " << off_deg << " degrees";
  return off_mm <= max_mm && off_deg <= max_deg;
}

MATCHER_P2(VectorNear, expected, tolerance, "") {
  const auto difference = (arg - expected).cwiseAbs().maxCoeff();
  *result_listener << "is (" << arg.transpose() << "), off by " << difference;
  return difference <= tolerance;
}

}  // namespace isoshift
