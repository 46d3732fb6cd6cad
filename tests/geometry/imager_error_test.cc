#include "geometry/imager_error.h"

#include <gtest/gtest.h>

#include <numbers>

#include "geometry/rotation.h"
#include "phantom/xray_simulation.h"
#include "tests/support/gantry_view.h"
#include "tests/support/pose_near.h"

namespace isoshift::imager_error_test {
namespace {

double& of(ImagerErrors& errors, ImagerParameter parameter) { return errors[static_cast<std::size_t>(parameter)]; }

TEST(ImagerModel, WithoutErrorsProjectsAsTheViewDoes) {
  for (const double gantry_deg : {0.0, 37.0, 90.0, 200.0}) {
    const XrayView view = view_from_gantry(gantry_deg);
    const ImagerModel model(view, rad_from_deg(gantry_deg), kGantryViewSidMm);
    EXPECT_NEAR(model.pixel_mm(), kGantryViewPixelMm, 1e-12);
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(40, -60, 80)})
      EXPECT_THAT(model.pixel_of(point, {}), VectorNear(view.project(point).value(), 1e-9));
  }
}

// The phantom writes down where the pixels of a faulty panel lie, and shares no camera with the model.
TEST(ImagerModel, ErrorsAreThoseOfThePhantomsPanel) {
  const PanelFault fault{.shift_mm = {1.5, -2.5}, .turn_deg = {0.7, -0.4, 1.2}};
  ImagerErrors errors{};
  of(errors, ImagerParameter::kShiftX) = fault.shift_mm.x();
  of(errors, ImagerParameter::kShiftY) = fault.shift_mm.y();
  of(errors, ImagerParameter::kTiltX) = rad_from_deg(fault.turn_deg.x());
  of(errors, ImagerParameter::kTiltY) = rad_from_deg(fault.turn_deg.y());
  of(errors, ImagerParameter::kRoll) = rad_from_deg(fault.turn_deg.z());
  for (const double gantry_deg : {0.0, 90.0, 213.0}) {
    const Imager imager{
        .gantry_angle_deg = gantry_deg, .pixels = kGantryViewPixels, .pixel_mm = kGantryViewPixelMm, .fault = fault};
    const ImagerModel model(view_from_gantry(gantry_deg), rad_from_deg(gantry_deg), kGantryViewSidMm);
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(255.5, 255.5), Eigen::Vector2d(30, 400), Eigen::Vector2d(500, 10)}) {
      const Eigen::Vector3d source = imager.source_fixed_mm();
      const Eigen::Vector3d on_ray = source + 0.6 * (imager.pixel_fixed_mm(pixel.x(), pixel.y()) - source);
      EXPECT_THAT(model.pixel_of(on_ray, errors), VectorNear(pixel, 1e-8)) << gantry_deg;
    }
  }
}

// A receptor that sags away by cosine and sine of the gantry angle, and lies 10 mm nearer to the source.
TEST(ImagerModel, SagFollowsTheGantryAndDistanceScales) {
  ImagerErrors errors{};
  of(errors, ImagerParameter::kShiftYCos) = 0.8;
  of(errors, ImagerParameter::kShiftXSin) = 1.6;
  const ImagerModel top(view_from_gantry(0.0), 0.0, kGantryViewSidMm),
      right(view_from_gantry(90.0), 0.5 * std::numbers::pi, kGantryViewSidMm);
  const Eigen::Vector2d center(255.5, 255.5);
  // Rows count downward: a receptor shifted toward the gantry shows the isocenter one row lower.
  EXPECT_THAT(top.pixel_of({0, 0, 0}, errors), VectorNear(center + Eigen::Vector2d(0, 1), 1e-9));
  EXPECT_THAT(right.pixel_of({0, 0, 0}, errors), VectorNear(center - Eigen::Vector2d(2, 0), 1e-9));
  ImagerErrors nearer{};
  of(nearer, ImagerParameter::kDistance) = 15.0;
  const Eigen::Vector2d at = top.pixel_of({50, 0, 0}, {}) - center, scaled = top.pixel_of({50, 0, 0}, nearer) - center;
  EXPECT_NEAR(scaled.x() / at.x(), 1485.0 / 1500.0, 1e-12);
}

// A view with errors is a camera like any other: it shows points where the imager does, and its rays go through them.
TEST(ImagerModel, AViewWithErrorsShowsWhatTheImagerDoes) {
  const ImagerErrors errors = {1.5, 0.3, -0.2, -2.0, 0.1, 0.4, 12.0, 0.01, -0.02, 0.03};
  for (const double gantry_deg : {0.0, 90.0, 213.0}) {
    const double gantry_rad = rad_from_deg(gantry_deg);
    const XrayView view = view_from_gantry(gantry_deg), other = with_errors(view, gantry_rad, kGantryViewSidMm, errors);
    const ImagerModel model(view, gantry_rad, kGantryViewSidMm);
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(40, -60, 80)}) {
      const Eigen::Vector2d pixel = other.project(point).value();
      EXPECT_THAT(pixel, VectorNear(model.pixel_of(point, errors), 1e-9));
      const Ray ray = other.ray(pixel.x(), pixel.y());
      const Eigen::Vector3d along = (ray.pixel_room_mm - ray.source_room_mm).normalized();
      EXPECT_LT(along.cross(point - ray.source_room_mm).norm(), 1e-6);
      EXPECT_THAT(ray.source_room_mm, VectorNear(view.source_room_mm, 1e-9));
    }
    EXPECT_NEAR(other.pixel_from_room(2, 3), view.pixel_from_room(2, 3), 1e-12);
  }
}

// The same panel behind the patient, and described in the plane of the isocenter (SID = SAD), where rays end behind it.
TEST(ImagerModel, ShiftsCountOnTheReceptorWhereverRaysEnd) {
  const double corner_mm = 0.5 * (kGantryViewPixels - 1) * kGantryViewPixelMm;
  const XrayView at_axis = make_xray_view({.sad_mm = 1000.0,
                                           .column_spacing_mm = kGantryViewPixelMm / 1.5,
                                           .row_spacing_mm = kGantryViewPixelMm / 1.5,
                                           .position_mm = {-corner_mm / 1.5, corner_mm / 1.5},
                                           .columns = kGantryViewPixels,
                                           .rows = kGantryViewPixels},
                                          Beam::kKilovoltage);
  const ImagerModel behind(view_from_gantry(0.0), 0.0, kGantryViewSidMm), in_plane(at_axis, 0.0, 1000.0);
  EXPECT_NEAR(in_plane.pixel_mm(), kGantryViewPixelMm / 1.5, 1e-12);
  ImagerErrors by_panel{}, by_axis{};
  of(by_panel, ImagerParameter::kShiftX) = 3.0;
  of(by_axis, ImagerParameter::kShiftX) = 2.0;
  const Eigen::Vector3d point(20, -30, 40);
  EXPECT_THAT(in_plane.pixel_of(point, {}), VectorNear(at_axis.project(point).value(), 1e-9));
  EXPECT_THAT(in_plane.pixel_of(point, by_axis), VectorNear(behind.pixel_of(point, by_panel), 1e-9));
}

// What is corrected leaves its sigma; what is not, its value, too.
TEST(KnownImager, WhatIsNotCorrectedIsLeft) {
  KnownImager imager;
  imager.values[0] = 4.0;
  imager.sigmas[0] = 3.0;
  EXPECT_DOUBLE_EQ(imager.left()[0], 5.0);
  imager.is_corrected = true;
  EXPECT_DOUBLE_EQ(imager.left()[0], 3.0);
}

}  // namespace
}  // namespace isoshift::imager_error_test
