#include "workflow/manual/landmarks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "geometry/rotation.h"

namespace isoshift::landmarks_test {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

XrayView view_at(double gantry_deg) {
  return make_xray_view({.sad_mm = 1000.0,
                         .gantry_angle_rad = rad_from_deg(gantry_deg),
                         .receptor_translation_mm = {0, 0, -500},
                         .column_spacing_mm = 0.8,
                         .row_spacing_mm = 0.8,
                         .position_mm = {-204.4, 204.4},
                         .columns = 512,
                         .rows = 512},
                        Beam::kKilovoltage);
}

Eigen::Isometry3d pose_of(const Vector3d& mm, double deg, const Vector3d& axis) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(rad_from_deg(deg), axis.normalized()).toRotationMatrix();
  pose.translation() = mm;
  return pose;
}

class LandmarksTest : public testing::Test {
 protected:
  // Points planned at these places, mm in the room, as the X-rays show them and as the DRRs do.
  std::vector<Landmark> marked(const std::vector<Vector3d>& planned) const {
    std::vector<Landmark> all;
    for (const Vector3d& point : planned) {
      Landmark& landmark = all.emplace_back();
      for (const XrayView& view : views_) {
        landmark.in_xrays.push_back(view.project(truth_ * point));
        landmark.in_drrs.push_back(view.project(current_ * point));
      }
    }
    return all;
  }
  std::string error_of(const std::vector<Landmark>& landmarks) const {
    try {
      fit_landmarks(views_, landmarks, current_);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }

  std::vector<XrayView> views_ = {view_at(0), view_at(90)};
  Eigen::Isometry3d truth_ = pose_of({12, -7, 4}, 11, {1, 2, 3}), current_ = pose_of({-3, 1, 2}, 4, {0, 1, -1});
};

TEST_F(LandmarksTest, ThreeOrMoreGiveTheWholePose) {
  const LandmarkFit fit =
      fit_landmarks(views_, marked({{40, 0, 10}, {-30, 20, 0}, {0, -50, -20}, {5, 10, 45}}), current_);
  EXPECT_TRUE(fit.setup_error.isApprox(truth_, 1e-9));
  EXPECT_LT(fit.left_mm, 1e-6);
  EXPECT_LT(fit.apart_mm, 1e-6);
}

TEST_F(LandmarksTest, OneMovesAndDoesNotTurn) {
  const Vector3d point(20, 10, -15);
  const LandmarkFit fit = fit_landmarks(views_, marked({point}), current_);
  EXPECT_TRUE((fit.setup_error * point).isApprox(truth_ * point, 1e-9));
  EXPECT_TRUE(fit.setup_error.linear().isApprox(current_.linear(), 1e-12));
}

TEST_F(LandmarksTest, TwoTurnTheirLine) {
  const Vector3d a(20, 10, -15), b(-40, 30, 25);
  const LandmarkFit fit = fit_landmarks(views_, marked({a, b}), current_);
  EXPECT_TRUE((fit.setup_error * a).isApprox(truth_ * a, 1e-9));
  EXPECT_TRUE((fit.setup_error * b).isApprox(truth_ * b, 1e-9));
}

TEST_F(LandmarksTest, ImpreciseClicksAreSaid) {
  std::vector<Landmark> landmarks = marked({{40, 0, 10}, {-30, 20, 0}, {0, -50, -20}});
  landmarks[1].in_xrays[0]->y() += 4.0;  // along y, which both views see
  const LandmarkFit fit = fit_landmarks(views_, landmarks, current_);
  // 4 pixels are 2.1 mm at the isocenter: the rays pass each other at that distance, and the point lies in the middle.
  EXPECT_NEAR(fit.apart_mm, 1.07, 0.1);
  EXPECT_GT(fit.left_mm, 0.1);
  EXPECT_LT((fit.setup_error.translation() - truth_.translation()).norm(), 2.0);
}

TEST_F(LandmarksTest, WhatDoesNotDetermineAPoseIsRefused) {
  EXPECT_THAT(error_of({}), HasSubstr("No landmark"));
  std::vector<Landmark> one = marked({{40, 0, 10}});
  one[0].in_drrs[1].reset();
  EXPECT_THAT(error_of(one), HasSubstr("Landmark 1 in the DRRs: mark it in at least two views"));
  EXPECT_THAT(error_of(marked({{40, 0, 10}, {40, 0, 10.5}})), HasSubstr("Landmarks 1 and 2 are at one place"));
  EXPECT_THAT(error_of(marked({{40, 0, 10}, {0, 0, 0}, {-80, 0, -20}})), HasSubstr("lie on a line"));
  views_ = {view_at(0), view_at(5)};
  EXPECT_THAT(error_of(marked({{40, 0, 10}})), HasSubstr("from nearly one direction"));
  views_ = {view_at(0), view_at(180)};
  EXPECT_THAT(error_of(marked({{40, 0, 10}})), HasSubstr("from nearly one direction"));
}

}  // namespace
}  // namespace isoshift::landmarks_test
