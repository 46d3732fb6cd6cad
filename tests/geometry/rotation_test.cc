#include "geometry/rotation.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "tests/support/pose_near.h"

namespace isoshift::rotation_test {
namespace {

TEST(Rotation, IsRightHandedAboutEveryAxis) {
  const double quarter = rad_from_deg(90.0);
  EXPECT_THAT(Eigen::Vector3d(rotation_x(quarter) * Eigen::Vector3d::UnitY()),
              VectorNear(Eigen::Vector3d(0, 0, 1), 1e-15));
  EXPECT_THAT(Eigen::Vector3d(rotation_y(quarter) * Eigen::Vector3d::UnitZ()),
              VectorNear(Eigen::Vector3d(1, 0, 0), 1e-15));
  EXPECT_THAT(Eigen::Vector3d(rotation_z(quarter) * Eigen::Vector3d::UnitX()),
              VectorNear(Eigen::Vector3d(0, 1, 0), 1e-15));
}

TEST(Rotation, PlacesMoveWithSmallMotions) {
  const Eigen::Vector3d place(20.0, -30.0, 50.0), translation(1e-4, 2e-4, -3e-4), turn(2e-6, -1e-6, 3e-6);
  const Eigen::Vector3d moved = rotation_from_vector(turn) * place + translation;
  const Eigen::Vector<double, 6> motion = (Eigen::Vector<double, 6>() << translation, turn).finished();
  EXPECT_THAT(Eigen::Vector3d(place + place_per_motion(place) * motion), VectorNear(moved, 1e-9));
}

TEST(Rotation, ZxyAnglesComposeAndDecompose) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> turn(-3.14, 3.14), tilt(-1.57, 1.57);
  for (int n = 0; n < 1000; ++n) {
    const ZxyAngles angles{.z_rad = turn(random), .x_rad = tilt(random), .y_rad = turn(random)};
    const ZxyAngles found = zxy_from_rotation(rotation_from_zxy(angles));
    ASSERT_NEAR(found.z_rad, angles.z_rad, 1e-11);
    ASSERT_NEAR(found.x_rad, angles.x_rad, 1e-11);
    ASSERT_NEAR(found.y_rad, angles.y_rad, 1e-11);
  }
}

TEST(Rotation, AnglesWrapToHalfATurn) {
  EXPECT_NEAR(deg_from_rad(wrapped_rad(rad_from_deg(359.998))), -0.002, 1e-12);
  EXPECT_DOUBLE_EQ(wrapped_rad(rad_from_deg(540.0)), std::numbers::pi);
  EXPECT_DOUBLE_EQ(wrapped_rad(rad_from_deg(-180.0)), std::numbers::pi);
}

TEST(Rotation, AMatrixIsARigidMotionOrNothing) {
  Eigen::Affine3d matrix = Eigen::Affine3d::Identity();
  matrix.linear() = rotation_z(0.3);
  matrix.translation() = Eigen::Vector3d(1, 2, 3);
  ASSERT_TRUE(as_rigid(matrix));
  EXPECT_TRUE(as_rigid(matrix)->isApprox(Eigen::Isometry3d(matrix.matrix())));
  Eigen::Affine3d mirrored = matrix, longer = matrix, unknown = matrix;
  mirrored.linear().col(0) *= -1.0;
  longer.linear() *= 1.001;
  unknown.linear()(0, 0) = std::numeric_limits<double>::quiet_NaN();
  for (const Eigen::Affine3d& wrong : {mirrored, longer, unknown}) EXPECT_FALSE(as_rigid(wrong));
}

}  // namespace
}  // namespace isoshift::rotation_test
