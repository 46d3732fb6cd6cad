#include "geometry/target_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "tests/drr/test_views.h"

namespace isoshift::target_error_test {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

Isometry3d translation(const Vector3d& by_mm) {
  Isometry3d pose = Isometry3d::Identity();
  pose.translation() = by_mm;
  return pose;
}

Isometry3d rotation(double angle_rad, const Vector3d& axis) {
  return Isometry3d(Eigen::AngleAxisd(angle_rad, axis.normalized()));
}

// Some setup error to measure from: errors do not depend on it where they should not.
Isometry3d some_truth() { return translation({4.0, -3.0, 7.0}) * rotation(0.1, {1.0, 2.0, -1.0}); }

// Source 1000 mm from the isocenter, receptor 500 mm behind it; gantry 0 looks down along z.
XrayView view_at(double gantry_deg) { return centered_view(gantry_deg, 200, 2.0); }

TEST(TargetError, StandardTargetsAreTheGridOfTheProtocol) {
  const std::vector<Vector3d> targets_mm = standard_targets_mm();
  std::set<std::array<double, 3>> different;
  for (const Vector3d& target : targets_mm) {
    different.insert({target.x(), target.y(), target.z()});
    for (const double coordinate : target) EXPECT_TRUE(std::abs(coordinate) == 50.0 || coordinate == 0.0);
  }
  EXPECT_EQ(targets_mm.size(), 27U);
  EXPECT_EQ(different.size(), 27U);
}

TEST(TargetError, OfATranslationIsItsLength) {
  const std::vector<Vector3d> targets_mm = standard_targets_mm();
  EXPECT_NEAR(mean_target_registration_error_mm(translation({3, -4, 12}), Isometry3d::Identity(), targets_mm), 13.0,
              1e-12);
  EXPECT_NEAR(mean_target_registration_error_mm(translation({3, -4, 12}) * some_truth(), some_truth(), targets_mm),
              13.0, 1e-12);
  EXPECT_NEAR(mean_target_registration_error_mm(some_truth(), some_truth(), targets_mm), 0.0, 1e-12);
}

TEST(TargetError, OfARotationIsTheChordOfEveryTarget) {
  const Vector3d far(10.0, 0.0, 5.0), on_axis(0.0, 0.0, -80.0);
  const Isometry3d quarter = rotation(std::numbers::pi / 2.0, Vector3d::UnitZ());
  // (10, 0) goes to (0, 10); what lies on the axis stays.
  EXPECT_NEAR(mean_target_registration_error_mm(quarter, Isometry3d::Identity(), std::array{far}),
              10.0 * std::numbers::sqrt2, 1e-12);
  EXPECT_NEAR(mean_target_registration_error_mm(quarter, Isometry3d::Identity(), std::array{far, on_axis}),
              5.0 * std::numbers::sqrt2, 1e-12);
}

TEST(TargetError, ProjectionsAreMagnifiedByTheDistances) {
  const std::array at_isocenter = {Vector3d(0, 0, 0), Vector3d(30, -20, 0)};
  EXPECT_NEAR(mean_projection_distance_mm(translation({3, 4, 0}), Isometry3d::Identity(), at_isocenter, view_at(0)),
              5.0 * 1500.0 / 1000.0, 1e-9);
  // Gantry 90: the same in the plane of y and z.
  const std::array in_plane = {Vector3d(0, 10, -20)};
  EXPECT_NEAR(mean_projection_distance_mm(translation({0, 3, 4}), Isometry3d::Identity(), in_plane, view_at(90)),
              5.0 * 1500.0 / 1000.0, 1e-9);
  // 100 mm nearer to the source.
  EXPECT_NEAR(mean_projection_distance_mm(translation({3, 4, 0}), Isometry3d::Identity(),
                                          std::array{Vector3d(10, 0, 100)}, view_at(0)),
              5.0 * 1500.0 / 900.0, 1e-9);
}

TEST(TargetError, ProjectionOfATargetBehindTheSourceIsInfinitelyFar) {
  const double distance_mm = mean_projection_distance_mm(translation({0, 0, 1100}), Isometry3d::Identity(),
                                                         std::array{Vector3d(0, 0, 0)}, view_at(0));
  EXPECT_TRUE(std::isinf(distance_mm)) << distance_mm;
}

TEST(TargetError, OneViewIsBlindAlongTheRayOfATarget) {
  const std::array target = {Vector3d(40, -30, 20)};
  for (const double gantry_deg : {0.0, 45.0, 90.0}) {
    const XrayView view = view_at(gantry_deg);
    const Vector3d along = (target[0] - view.source_room_mm).normalized();
    for (const double shift_mm : {-8.0, 15.0}) {
      const Isometry3d shifted = translation(shift_mm * along);
      EXPECT_NEAR(mean_reprojection_distance_mm(shifted, Isometry3d::Identity(), target, view), 0.0, 1e-9);
      EXPECT_NEAR(mean_projection_distance_mm(shifted, Isometry3d::Identity(), target, view), 0.0, 1e-9);
      EXPECT_NEAR(mean_target_registration_error_mm(shifted, Isometry3d::Identity(), target), std::abs(shift_mm),
                  1e-12);
    }
  }
}

TEST(TargetError, ReprojectionSeesWhatLiesAcrossTheRay) {
  const std::array isocenter = {Vector3d(0, 0, 0)};
  // The ray through (3, 4, 0) passes the isocenter at 5 mm times the cosine of its inclination.
  EXPECT_NEAR(mean_reprojection_distance_mm(translation({3, 4, 0}), Isometry3d::Identity(), isocenter, view_at(0)),
              5.0 * 1000.0 / std::hypot(1000.0, 5.0), 1e-9);
  // Not magnified, and never more than the error in space.
  const std::vector<Vector3d> targets_mm = standard_targets_mm();
  for (const Isometry3d& error : random_poses(10)) {
    const Isometry3d found = error * some_truth();
    EXPECT_LE(mean_reprojection_distance_mm(found, some_truth(), targets_mm, view_at(0)),
              mean_target_registration_error_mm(found, some_truth(), targets_mm));
  }
}

TEST(TargetError, RotationShareTellsTranslationFromRotation) {
  const std::vector<Vector3d> targets_mm = standard_targets_mm();
  EXPECT_EQ(rotation_share(some_truth(), some_truth(), std::array{Vector3d(0, 0, 0)}), 0.0);
  EXPECT_NEAR(rotation_share(translation({1, 2, 3}) * some_truth(), some_truth(), targets_mm), 0.0, 1e-9);
  EXPECT_NEAR(rotation_share(rotation(0.1, {1, 2, 3}), Isometry3d::Identity(), targets_mm), 1.0, 1e-12);
  // A quarter turn moves the target by 10 sqrt(2) mm, and a translation by as much again.
  const Isometry3d both =
      translation({0, 0, 10.0 * std::numbers::sqrt2}) * rotation(std::numbers::pi / 2.0, Vector3d::UnitZ());
  EXPECT_NEAR(rotation_share(both, Isometry3d::Identity(), std::array{Vector3d(10, 0, 0)}), 0.5, 1e-12);
}

}  // namespace
}  // namespace isoshift::target_error_test
