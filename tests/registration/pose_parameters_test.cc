#include "registration/pose_parameters.h"

#include <gtest/gtest.h>

namespace isoshift::pose_parameters_test {
namespace {

// The motion between two poses that lie close together: translation in mm, rotation vector in rad.
Eigen::Matrix<double, 6, 1> motion_between(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  const Eigen::Isometry3d motion = to * from.inverse();
  const Eigen::AngleAxisd turn(motion.linear());
  Eigen::Matrix<double, 6, 1> result;
  result << motion.translation(), turn.angle() * turn.axis();
  return result;
}

TEST(PoseParameters, MotionsAreTheDifferencesOfPoses) {
  constexpr double kStep = 1e-4;
  for (const std::vector<double>& at : std::vector<std::vector<double>>{
           {0, 0, 0, 0, 0, 0}, {3, -20, 8, 0, 0, 0}, {3, -20, 8, 25, -10, 17}, {0, 0, 0, 1e-3, 0, 2e-3}, {5, 6, 7}}) {
    const auto motions = motions_per_parameter(at);
    ASSERT_EQ(motions.cols(), static_cast<Eigen::Index>(at.size()));
    for (std::size_t axis = 0; axis < at.size(); ++axis) {
      std::vector<double> before = at, behind = at;
      before[axis] -= kStep;
      behind[axis] += kStep;
      const Eigen::Matrix<double, 6, 1> expected =
          motion_between(setup_error_from_parameters(before), setup_error_from_parameters(behind)) / (2.0 * kStep);
      EXPECT_LT((motions.col(static_cast<Eigen::Index>(axis)) - expected).norm(), 1e-5) << "parameter " << axis;
    }
  }
}

}  // namespace
}  // namespace isoshift::pose_parameters_test
