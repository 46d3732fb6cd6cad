#include "registration/region.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "registration/presets.h"
#include "setup/couch_shift.h"
#include "tests/drr/test_views.h"
#include "tests/support/pose_near.h"
#include "tests/support/registration_scene.h"

namespace isoshift::region_test {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// A ball in voxels of `spacing_mm`, in a lattice about it with some air around.
struct Ball {
  Vector3d center_mm;
  double radius_mm;
};

Volume<std::uint8_t> mask_of(const Ball& ball, const Vector3d& spacing_mm) {
  const Vector3i size = (2.2 * ball.radius_mm / spacing_mm.array()).ceil().cast<int>() + 3;
  Volume<std::uint8_t> mask(size, centered_volume(size, spacing_mm, 0.0F).patient_from_voxel);
  mask.patient_from_voxel.pretranslate(ball.center_mm);
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i)
        mask.at(i, j, k) =
            (mask.patient_from_voxel * Vector3d(i, j, k) - ball.center_mm).norm() <= ball.radius_mm ? 1 : 0;
  return mask;
}

double distance_mm(const Ray& ray, const Vector3d& point_mm) {
  const Vector3d way = (ray.pixel_room_mm - ray.source_room_mm).normalized();
  const Vector3d to_point = point_mm - ray.source_room_mm;
  return (to_point - to_point.dot(way) * way).norm();
}

FixedImage open_image(double gantry_deg) {
  FixedImage image;
  image.view = centered_view(gantry_deg, 120, 2.5);  // 1.67 mm at the isocenter
  image.line_integral = Image<float>(120, 120);
  image.field = Image<std::uint8_t>(120, 120, 1);
  return image;
}

// Expects 1 where a ray passes a ball within `radius_mm`, else 0; within `rim_mm` of that, anything.
void expect_shadow(const FixedImage& image, const Vector3d& center_room_mm, double radius_mm, double rim_mm,
                   int inside = 1) {
  int wrong = 0, in_shadow = 0;
  for (int row = 0; row < image.field.rows; ++row)
    for (int column = 0; column < image.field.columns; ++column) {
      const double off_mm = distance_mm(image.view.ray(column, row), center_room_mm) - radius_mm;
      in_shadow += off_mm < 0.0 ? 1 : 0;
      if (std::abs(off_mm) <= rim_mm) continue;
      const int expected = off_mm < 0.0 ? inside : 1 - inside;
      wrong += image.field.at(column, row) != expected ? 1 : 0;
    }
  EXPECT_GT(in_shadow, 100);
  EXPECT_EQ(wrong, 0) << "of " << in_shadow << " pixels in the shadow";
}

// Half a voxel of the mask, a coarser one as it is projected, and half a pixel.
constexpr double kRimMm = 3.0;

TEST(ProjectedRegion, CoversThePixelsWhoseRaysMeetIt) {
  const Ball ball{.center_mm = {10.0, -15.0, 20.0}, .radius_mm = 30.0};
  Eigen::Isometry3d pose = random_poses(1).front();
  for (const Vector3d& spacing_mm : {Vector3d(1, 1, 1), Vector3d(0.7, 0.7, 3.0)}) {
    const ProjectedRegion region({.volume = mask_of(ball, spacing_mm), .excluded = {}, .cut_ends = {}});
    for (const double gantry_deg : {0.0, 45.0, 90.0}) {
      FixedImage image = open_image(gantry_deg);
      region.restrict(image, pose, 0.0);
      expect_shadow(image, pose * ball.center_mm, ball.radius_mm, kRimMm);
    }
  }
}

TEST(ProjectedRegion, ForABeamOfMegavoltageToo) {
  const Ball ball{.center_mm = {0.0, 0.0, 0.0}, .radius_mm = 25.0};
  FixedImage image = open_image(0.0);
  image.view.beam = Beam::kMegavoltage;
  ProjectedRegion({.volume = mask_of(ball, Vector3d::Ones()), .excluded = {}})
      .restrict(image, Eigen::Isometry3d::Identity(), 0.0);
  expect_shadow(image, Vector3d::Zero(), ball.radius_mm, kRimMm);
}

TEST(ProjectedRegion, SlackGrowsIt) {
  const Ball ball{.center_mm = {-5.0, 10.0, 0.0}, .radius_mm = 20.0};
  const ProjectedRegion region({.volume = mask_of(ball, Vector3d::Ones()), .excluded = {}, .cut_ends = {}});
  for (const double slack_mm : {4.0, 12.0}) {
    FixedImage image = open_image(0.0);
    region.restrict(image, Eigen::Isometry3d::Identity(), slack_mm);
    expect_shadow(image, ball.center_mm, ball.radius_mm + slack_mm, kRimMm);
  }
}

TEST(ProjectedRegion, WhatIsLeftOutIsCutAndSlackCutsMore) {
  const Ball out{.center_mm = {15.0, 5.0, -10.0}, .radius_mm = 18.0};
  const ProjectedRegion region({.volume = {}, .excluded = {mask_of(out, Vector3d::Ones())}, .cut_ends = {}});
  for (const double slack_mm : {0.0, 6.0}) {
    FixedImage image = open_image(90.0);
    region.restrict(image, Eigen::Isometry3d::Identity(), slack_mm);
    expect_shadow(image, out.center_mm, out.radius_mm + slack_mm, kRimMm, /*inside=*/0);
  }
  // From within a volume, and only there.
  const Ball in{.center_mm = {15.0, 5.0, -10.0}, .radius_mm = 40.0};
  FixedImage image = open_image(90.0);
  ProjectedRegion(
      {.volume = mask_of(in, Vector3d::Ones()), .excluded = {mask_of(out, Vector3d::Ones())}, .cut_ends = {}})
      .restrict(image, Eigen::Isometry3d::Identity(), 0.0);
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 120; ++column) {
      const double from_axis_mm = distance_mm(image.view.ray(column, row), in.center_mm);
      if (std::abs(from_axis_mm - 18.0) < kRimMm || std::abs(from_axis_mm - 40.0) < kRimMm) continue;
      ASSERT_EQ(image.field.at(column, row), from_axis_mm > 18.0 && from_axis_mm < 40.0 ? 1 : 0);
    }
}

TEST(ProjectedRegion, NeverAddsToTheField) {
  FixedImage image = open_image(0.0);
  image.field = Image<std::uint8_t>(120, 120, 0);
  const Ball ball{.center_mm = Vector3d::Zero(), .radius_mm = 30.0};
  ProjectedRegion({.volume = mask_of(ball, Vector3d::Ones()), .excluded = {}})
      .restrict(image, Eigen::Isometry3d::Identity(), 5.0);
  EXPECT_EQ(std::ranges::count(image.field.pixels, 1), 0);
}

TEST(ProjectedRegion, OfEverythingLeavesTheFieldAlone) {
  FixedImage image = open_image(0.0);
  ProjectedRegion().restrict(image, Eigen::Isometry3d::Identity(), 0.0);
  const Volume<std::uint8_t> nothing(Vector3i(4, 4, 4), Eigen::Affine3d::Identity());
  ProjectedRegion({.volume = {}, .excluded = {nothing}, .cut_ends = {}})
      .restrict(image, Eigen::Isometry3d::Identity(), 0.0);
  EXPECT_EQ(std::ranges::count(image.field.pixels, 1), 120 * 120);
}

// HU in voxels whose centers lie inside.
Volume<float> ct_of(const Vector3i& size, const Vector3d& spacing_mm,
                    const std::function<bool(const Vector3d&)>& inside) {
  Volume<float> ct = centered_volume(size, spacing_mm, -1000.0F);
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i)
        if (inside(ct.patient_from_voxel * Vector3d(i, j, k))) ct.at(i, j, k) = 0.0F;
  return ct;
}

// Whether a point lies in a voxel of 1.
bool holds(const Volume<std::uint8_t>& mask, const Vector3d& point_mm) {
  const Vector3i at = (mask.patient_from_voxel.inverse() * point_mm).array().round().cast<int>();
  return (at.array() >= 0).all() && (at.array() < mask.size.array()).all() && mask.at(at.x(), at.y(), at.z()) != 0;
}

TEST(BeyondTheCt, IsNothingForABodyWithinIt) {
  const Volume<float> ct =
      ct_of({40, 40, 40}, Vector3d::Constant(4.0), [](const Vector3d& at) { return at.norm() < 60.0; });
  EXPECT_TRUE(beyond_the_ct(ct, -540.0).empty());
}

void expect_columns_beyond_both_ends(int slices, double thickness_mm) {
  // A cylinder of 30 mm radius along z, aside of the axis, that the CT cuts at both ends.
  const Vector3d axis_mm(12.0, -8.0, 0.0);
  const auto off_axis_mm = [&](const Vector3d& at) { return (at - axis_mm).head<2>().norm(); };
  const Volume<float> ct =
      ct_of({60, 60, slices}, {2.0, 2.0, thickness_mm}, [&](const Vector3d& at) { return off_axis_mm(at) < 30.0; });
  const double end_mm = 0.5 * slices * thickness_mm;
  constexpr double kReachMm = 60.0;
  const std::vector<CutEnds> ends = beyond_the_ct(ct, -540.0, kReachMm);
  ASSERT_EQ(ends.size(), 1U);
  const Volume<std::uint8_t>& beyond = ends.front().columns;
  for (const double side : {-1.0, 1.0})
    for (const double z_mm : {end_mm + 5.0, end_mm + 30.0, end_mm + kReachMm - 5.0}) {
      EXPECT_TRUE(holds(beyond, axis_mm + Vector3d(0, 0, side * z_mm))) << side * z_mm;
      EXPECT_TRUE(holds(beyond, axis_mm + Vector3d(25, 0, side * z_mm))) << side * z_mm;
      EXPECT_FALSE(holds(beyond, axis_mm + Vector3d(0, 36, side * z_mm))) << side * z_mm;
      EXPECT_FALSE(holds(beyond, axis_mm + Vector3d(-36, 0, side * z_mm))) << side * z_mm;
    }
  for (const double side : {-1.0, 1.0}) {
    EXPECT_FALSE(holds(beyond, axis_mm + Vector3d(0, 0, side * (end_mm + kReachMm + 10.0))));
    EXPECT_FALSE(holds(beyond, axis_mm + Vector3d(0, 0, side * (end_mm - 6.0))));
  }
  EXPECT_FALSE(holds(beyond, axis_mm));
  // Beside the body, nothing is cut.
  EXPECT_FALSE(holds(beyond, Vector3d(70, 0, 0)));
}

TEST(BeyondTheCt, IsTheColumnsAboveABodyThatTheCtCuts) { expect_columns_beyond_both_ends(20, 4.0); }

TEST(BeyondTheCt, IsTheSameForThinSlices) {
  expect_columns_beyond_both_ends(76, 1.0);
  expect_columns_beyond_both_ends(79, 1.0);
}

// Slices are looked at in blocks of about 4 mm.
TEST(BeyondTheCt, IsTheSameForEveryNumberOfSlices) {
  for (const int slices : {76, 77, 78, 79}) {
    SCOPED_TRACE(slices);
    expect_columns_beyond_both_ends(slices, 1.0);
  }
}

TEST(BeyondTheCt, IsFoundOnEveryFace) {
  for (int axis = 0; axis < 3; ++axis) {
    const Volume<float> ct = ct_of({24, 24, 24}, Vector3d::Constant(4.0), [&](const Vector3d& at) {
      return at[(axis + 1) % 3] * at[(axis + 1) % 3] + at[(axis + 2) % 3] * at[(axis + 2) % 3] < 400.0;
    });
    const std::vector<CutEnds> ends = beyond_the_ct(ct, -540.0, 40.0);
    ASSERT_EQ(ends.size(), 1U);
    EXPECT_EQ(ends.front().along_patient, Vector3d::Unit(axis));
    const Volume<std::uint8_t>& beyond = ends.front().columns;
    for (int other = 0; other < 3; ++other)
      for (const double side : {-70.0, 70.0})
        EXPECT_EQ(holds(beyond, side * Vector3d::Unit(other)), other == axis) << axis << other << side;
  }
}

TEST(Region, OnlyInsideAndWithoutShareTheCt) {
  const Volume<float> ct = textured_volume();
  Volume<std::uint8_t> mask(ct.size, ct.patient_from_voxel);
  for (std::size_t n = 0; n < mask.voxels.size(); n += 3) mask.voxels[n] = 1;
  const Volume<float> inside = only_inside(ct, mask), outside = without(ct, mask);
  EXPECT_EQ(inside.patient_from_voxel.matrix(), ct.patient_from_voxel.matrix());
  for (std::size_t n = 0; n < ct.voxels.size(); ++n) {
    ASSERT_EQ(inside.voxels[n], mask.voxels[n] != 0 ? ct.voxels[n] : -1000.0F);
    ASSERT_EQ(outside.voxels[n], mask.voxels[n] != 0 ? -1000.0F : ct.voxels[n]);
  }
}

// X-rays and a CT of a lumbar spine, cut off above and below.
RegistrationScene cut_spine(const Vector3d& ct_mm) {
  SceneOptions options{.shapes = spine_phantom(Vector3d::Zero(), 1), .pixels = 128};
  options.placement.translation_mm = Vector3d(4.0, -6.0, 3.0);
  options.placement.rotation_deg = Vector3d(1.0, -1.5, 1.2);
  options.ct_mm = ct_mm;
  options.voxel_mm = 2.0;
  return make_scene(options);
}

Eigen::Isometry3d registered(const RegistrationScene& scene) {
  const auto region = std::make_shared<const ProjectedRegion>(RegionOfInterest{
      .volume = {}, .excluded = {}, .cut_ends = beyond_the_ct(scene.ct, AttenuationModel{}.threshold_hu)});
  RegistrationOptions registration = preset("setup");
  registration.check_alternatives = false;
  registration.region = region;
  const auto result = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, registration);
  return setup_error_from_poses(scene.planned, result.actual_room_from_patient);
}

// Above and below the CT the X-rays show vertebrae that the DRRs cannot: without leaving them out, the search is drawn
// along the spine.
TEST(Region, ASpineOfWhichTheCtHoldsAPartIsRegistered) {
  const RegistrationScene scene = cut_spine({320.0, 280.0, 100.0});
  EXPECT_THAT(registered(scene), PoseNear(scene.truth, 0.7, 0.5));
  RegistrationOptions of_all = preset("setup");
  of_all.check_alternatives = false;
  const auto drawn = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, of_all);
  EXPECT_THAT(setup_error_from_poses(scene.planned, drawn.actual_room_from_patient),
              testing::Not(PoseNear(scene.truth, 0.7, 0.5)));
}

// A sphere of 18 mm: pixels are kept small enough that something is left to compare.
TEST(Region, ASmallVolumeIsRegistered) {
  SceneOptions options{.shapes = asymmetric_body(), .pixels = 256};
  options.placement.translation_mm = Vector3d(2.0, -1.5, 1.0);
  options.placement.rotation_deg = Vector3d(0.5, -0.5, 0.4);
  const RegistrationScene scene = make_scene(options);
  const auto region = std::make_shared<const ProjectedRegion>(RegionOfInterest{
      .volume = mask_of({.center_mm = Vector3d(10.0, 20.0, -20.0), .radius_mm = 18.0}, Vector3d::Ones()),
      .excluded = {},
      .cut_ends = {}});
  RegistrationOptions registration = preset("setup");
  registration.region = region;
  const auto result = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, registration);
  EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient), PoseNear(scene.truth, 1.0, 2.0));
  EXPECT_NE(result.verdict(), Verdict::kAccepted);  // too little to tell whether anatomy moved
}

// In front of a belly that the CT cuts, what lies beyond covers the whole anterior view and cannot be left out there;
// what lies above and below the CT is left out nevertheless.
TEST(Region, APatientThickerThanTheCtIsRegistered) {
  const RegistrationScene scene = cut_spine({320.0, 210.0, 100.0});
  EXPECT_THAT(registered(scene), PoseNear(scene.truth, 0.7, 0.5));
}

}  // namespace
}  // namespace isoshift::region_test
