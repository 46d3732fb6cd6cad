#include "registration/imager/bundle_adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.h"
#include "geometry/rotation.h"
#include "phantom/shapes.h"
#include "phantom/xray_simulation.h"
#include "tests/support/gantry_view.h"
#include "tests/support/pose_near.h"

namespace isoshift::bundle_adjustment_test {
namespace {

using testing::HasSubstr;

Eigen::Isometry3d motion(const Eigen::Vector3d& mm, const Eigen::Vector3d& deg) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = mm;
  pose.linear() = rotation_from_zxy({rad_from_deg(deg.z()), rad_from_deg(deg.x()), rad_from_deg(deg.y())});
  return pose;
}

std::vector<Ball> cube_of_balls() {
  std::vector<Ball> balls;
  for (const double x : {-70.0, -10.0, 60.0})
    for (const double y : {-65.0, 5.0, 70.0})
      for (const double z : {-60.0, 55.0})
        balls.push_back({.center_patient_mm = {x, y + 0.1 * x, z - 0.2 * y}, .radius_mm = 3.0});
  return balls;
}

// Spots where an imager with these errors shows the balls of a session, and false ones.
BallSession session_of(const std::vector<Ball>& balls, const Eigen::Isometry3d& setup_error, const ImagerErrors& errors,
                       double noise_px, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0.0, noise_px);
  std::uniform_real_distribution<double> anywhere(20.0, kGantryViewPixels - 20.0);
  BallSession session{.name = "a", .views = {}};
  for (int n = 0; n < 8; ++n) {
    const double gantry_deg = 45.0 * n;
    BallView view{.label = "",
                  .model = ImagerModel(view_from_gantry(gantry_deg), rad_from_deg(gantry_deg), kGantryViewSidMm),
                  .spots = {.places = {}, .field = Image<std::uint8_t>(kGantryViewPixels, kGantryViewPixels, 1)}};
    for (const Ball& ball : balls) {
      const double du = noise(random), dv = noise(random);
      view.spots.places.push_back(view.model.pixel_of(setup_error * ball.center_patient_mm, errors) +
                                  Eigen::Vector2d(du, dv));
    }
    for (int false_one = 0; false_one < 5; ++false_one) {
      const double u = anywhere(random), v = anywhere(random);
      view.spots.places.emplace_back(u, v);
    }
    session.views.push_back(std::move(view));
  }
  return session;
}

const ImagerErrors kPlanted = {
    1.5, 0.4, -0.3, -1.2, 0.5, 0.2, 4.0, rad_from_deg(0.3), rad_from_deg(-0.4), rad_from_deg(0.5)};

TEST(BundleAdjustment, FindsAllErrorsWherePositionsAreKnown) {
  std::mt19937_64 random(5);
  const std::vector<Ball> balls = cube_of_balls();
  std::vector<BallSession> sessions;
  for (const auto& pose : {motion({3, -2, 1}, {1, 0, -1}), motion({-4, 5, 2}, {0, 2, 1})}) {
    sessions.push_back(session_of(balls, pose, kPlanted, 0.05, random));
    sessions.back().known_setup_error = pose;
  }
  const BundleAdjustment found = adjusted(balls, sessions, BallPoses::kPositions, 1);
  ASSERT_EQ(found.imagers.size(), 1U);
  for (std::size_t n = 0; n < kImagerParameters; ++n) {
    const auto& parameter = found.imagers.front().parameters[n];
    EXPECT_TRUE(parameter.is_determined) << imager_parameters()[n].name;
    EXPECT_LT(std::abs(parameter.value - kPlanted[n]), 4.0 * parameter.sigma) << imager_parameters()[n].name;
  }
  EXPECT_NEAR(found.rms_mm, 0.05 * kGantryViewPixelMm, 0.01);
}

// Poses are found beside the errors, and which errors act like poses is said.
TEST(BundleAdjustment, FreePosesAreFoundAndSigmasHoldTheErrors) {
  std::mt19937_64 random(6);
  const std::vector<Ball> balls = cube_of_balls();
  const Eigen::Isometry3d pose = motion({6, -7, 5}, {2, -1.5, 1});
  int within = 0, all = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const BundleAdjustment found =
        adjusted(balls, {session_of(balls, pose, kPlanted, 0.1, random)}, BallPoses::kFree, 1);
    for (std::size_t n = 0; n < kImagerParameters; ++n) {
      const auto& parameter = found.imagers.front().parameters[n];
      ++all;
      within += std::abs(parameter.value - kPlanted[n]) < parameter.sigma ? 1 : 0;
    }
    EXPECT_THAT(found.setup_errors.front().translation(), VectorNear(pose.translation(), 1.5));
    EXPECT_LT(found.pose_sigmas.front()[3], rad_from_deg(0.1));
  }
  const double share = static_cast<double>(within) / all;
  EXPECT_GT(share, 0.55) << "68 % are expected";
  EXPECT_LT(share, 0.85);
}

// One ball on the axis, free: of its position along y and the receptor's shift along y only the sum is seen.
TEST(BundleAdjustment, WhatASingleBallCannotTellIsNotDetermined) {
  std::mt19937_64 random(7);
  const std::vector<Ball> ball = {{.center_patient_mm = {0, 0, 0}, .radius_mm = 3.0}};
  const ImagerErrors shifted = {1.0, 0, 0, 2.0, 0, 0, 0, 0, 0, 0};
  const BundleAdjustment found =
      adjusted(ball, {session_of(ball, motion({1, 1, 1}, {0, 0, 0}), shifted, 0.02, random)}, BallPoses::kFree, 1);
  const auto parameter = [&](ImagerParameter which) {
    return found.imagers.front().parameters[static_cast<std::size_t>(which)];
  };
  EXPECT_TRUE(parameter(ImagerParameter::kShiftX).is_determined) << "the views oppose each other";
  EXPECT_NEAR(parameter(ImagerParameter::kShiftX).value, 1.0, 0.1);
  for (const ImagerParameter which : {ImagerParameter::kShiftY, ImagerParameter::kShiftXCos, ImagerParameter::kTiltX,
                                      ImagerParameter::kTiltY, ImagerParameter::kDistance, ImagerParameter::kRoll})
    EXPECT_FALSE(parameter(which).is_determined) << static_cast<int>(which);
  EXPECT_GT(found.pose_sigmas.front()[1], 1.0) << "along y";
}

TEST(BundleAdjustment, AnotherPhantomIsRefused) {
  std::mt19937_64 random(8);
  const std::vector<Ball> balls = cube_of_balls();
  BallSession session = session_of(balls, motion({0, 0, 0}, {0, 0, 0}), {}, 0.05, random);
  for (BallView& view : session.views) view.spots.places.clear();
  try {
    adjusted(balls, {session}, BallPoses::kFree, 1);
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("places at which the X-rays should show balls, 0 do"));
  }
}

// A field that shows half of the balls: the others are not missed.
TEST(BundleAdjustment, BallsOutsideTheFieldAreNotExpected) {
  std::mt19937_64 random(9);
  const std::vector<Ball> balls = cube_of_balls();
  const Eigen::Isometry3d pose = motion({2, -1, 1}, {0.5, 0, -0.5});
  BallSession session = session_of(balls, pose, {}, 0.05, random);
  const std::size_t all = adjusted(balls, {session}, BallPoses::kFree, 1).expected;
  for (BallView& view : session.views) {
    Image<std::uint8_t>& field = view.spots.field;
    std::fill_n(field.pixels.begin(), field.pixels.size() / 2, std::uint8_t{0});
    std::erase_if(view.spots.places, [&](const Eigen::Vector2d& place) { return place.y() < field.rows / 2; });
  }
  const BundleAdjustment found = adjusted(balls, {session}, BallPoses::kFree, 1);
  EXPECT_LT(found.expected, 3 * all / 4);
  EXPECT_GT(found.seen, found.expected * 9 / 10);
  const Eigen::Vector3d off_mm = found.setup_errors.front().translation() - pose.translation();
  for (Eigen::Index axis = 0; axis < 3; ++axis)
    EXPECT_LT(std::abs(off_mm[axis]), 4.0 * found.pose_sigmas.front()[static_cast<std::size_t>(axis)]) << axis;
}

TEST(BundleAdjustment, BallsThatHideEachOtherAreAnError) {
  std::mt19937_64 random(10);
  const std::vector<Ball> balls = {{.center_patient_mm = {0, 0, 0}, .radius_mm = 3.0},
                                   {.center_patient_mm = {0, 4, 0}, .radius_mm = 3.0}};
  BallSession session = session_of(balls, motion({0, 0, 0}, {0, 0, 0}), {}, 0.05, random);
  for (BallView& view : session.views) view.radius_px = 20.0;
  try {
    adjusted(balls, {session}, BallPoses::kFree, 1);
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("session a: its X-rays should show no ball alone"));
  }
}

TEST(Balls, OfACtLieWhereTheirShapesDo) {
  const Eigen::Vector3d a(-31.3, 12.7, 8.2), b(25.4, -20.1, -14.9);
  std::vector<Shape> shapes = {
      make_shape(Shape::Kind::kBox, Eigen::Vector3d::Zero(), Eigen::Vector3d(60, 60, 40), {.water = 1.0, .bone = 0.0})};
  for (const Eigen::Vector3d& center : {a, b})
    shapes.push_back(
        make_shape(Shape::Kind::kEllipsoid, center, Eigen::Vector3d::Constant(3.0), {.water = -1.0, .bone = 6.0}));
  Eigen::Affine3d lattice = Eigen::Affine3d::Identity();
  lattice.linear() = Eigen::Vector3d(1.0, 1.0, 1.5).asDiagonal();
  lattice.translation() = Eigen::Vector3d(-64, -64, -45);
  const std::vector<Ball> balls = balls_in(ct_of_shapes(shapes, {128, 128, 60}, lattice));
  ASSERT_EQ(balls.size(), 2U);
  for (const Ball& ball : balls) {
    EXPECT_LT(std::min((ball.center_patient_mm - a).norm(), (ball.center_patient_mm - b).norm()), 0.1);
    EXPECT_NEAR(ball.radius_mm, 3.0, 0.3);
  }
  shapes.push_back(make_shape(Shape::Kind::kBox, {0, 0, 0}, {20, 2, 2}, {.water = -1.0, .bone = 6.0}));
  EXPECT_THROW(balls_in(ct_of_shapes(shapes, {128, 128, 60}, lattice)), Error) << "a rod";
  shapes.resize(1);
  EXPECT_THROW(balls_in(ct_of_shapes(shapes, {128, 128, 60}, lattice)), Error) << "no metal";
}

}  // namespace
}  // namespace isoshift::bundle_adjustment_test
