#include "registration/quality/consistency.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/support/pose_near.h"
#include "tests/support/registration_scene.h"

namespace isoshift::consistency_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Small bones everywhere in tissue that is wider than the views: something to match in every part of both.
std::vector<Shape> grainy_block() {
  std::vector<Shape> shapes = {make_shape(Shape::Kind::kBox, {0, 0, 0}, Vector3d::Constant(128.0), {.water = 0.5})};
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place_mm(-110.0, 110.0), half_mm(3.0, 8.0);
  for (int n = 0; n < 250; ++n) {
    const Vector3d at(place_mm(random), place_mm(random), place_mm(random));
    const Vector3d half(half_mm(random), half_mm(random), half_mm(random));
    shapes.push_back(make_shape(Shape::Kind::kEllipsoid, at, half, {.bone = 0.5}));
  }
  return shapes;
}

SceneOptions options_with(const Vector3d& translation_mm) {
  SceneOptions options{.shapes = grainy_block(), .pixels = 160};
  options.placement.translation_mm = translation_mm;
  options.ct_mm = Vector3d::Constant(256.0);
  options.voxel_mm = 2.0;
  return options;
}

const RegistrationScene& registered() {
  static const RegistrationScene scene = make_scene(options_with(Vector3d::Zero()));
  return scene;
}

// The scene, with the left half of view 1 (gantry 0: columns along x, rows against y) as it is where the anatomy
// there moved.
std::vector<FixedImage> images_with_left_half_moved(const Vector3d& by_mm) {
  std::vector<FixedImage> images = registered().images;
  const FixedImage moved = prepare(xrays_of(options_with(by_mm)).front());
  for (int row = 0; row < images[0].line_integral.rows; ++row)
    for (int column = 0; column < images[0].line_integral.columns / 2; ++column)
      images[0].line_integral.at(column, row) = moved.line_integral.at(column, row);
  return images;
}

std::vector<ViewConsistency> consistency_of(const std::vector<FixedImage>& images) {
  return regional_consistency(*registered().renderers, {.images = images, .region = registered().everything},
                              registered().planned);
}

TEST(Consistency, AllPartsOfARegisteredPatientAgree) {
  const auto views = consistency_of(registered().images);
  ASSERT_EQ(views.size(), 2U);
  for (const ViewConsistency& view : views) {
    EXPECT_GT(view.with_signal(), 10);
    EXPECT_EQ(view.disagreeing(), 0);
    for (const ViewPart& tile : view.parts) {
      EXPECT_GT(tile.width_px, 10.0);
      EXPECT_TRUE((tile.center_px.array() > 0.0).all() && (tile.center_px.array() < 160.0).all());
      if (tile.has_signal) {
        EXPECT_LT(tile.displacement_mm.norm(), 1.0) << tile.center_px.transpose();
      }
    }
  }
}

// A tile is looked for in the DRR: where anatomy moved one way, it matches the other way.
TEST(Consistency, PartsThatMovedSayWhereToAndTheOthersAgree) {
  for (const Vector3d& by_mm : {Vector3d(6, 0, 0), Vector3d(-5, 4, 0), Vector3d(0, -7, 0)}) {
    const auto views = consistency_of(images_with_left_half_moved(by_mm));
    const Vector2d expected_mm(-by_mm.x(), by_mm.y());
    int moved = 0, in_place = 0;
    for (const ViewPart& tile : views[0].parts) {
      const double right = tile.center_px.x() + 0.5 * tile.width_px, left = tile.center_px.x() - 0.5 * tile.width_px;
      // Pixels of 1.25 mm at the isocenter. What moved in from beyond the view cannot be found.
      const Vector2d match_px = tile.center_px + expected_mm / 1.25;
      const bool can_be_found = ((match_px.array() - 80.0).abs() < 79.0 - 0.5 * tile.width_px).all();
      if (right < 78.0 && can_be_found) {
        ++moved;
        // What lies off the isocenter's plane is magnified a little more or less.
        EXPECT_THAT(tile.displacement_mm, VectorNear(expected_mm, 1.0)) << tile.center_px.transpose();
        EXPECT_TRUE(tile.disagrees) << tile.center_px.transpose() << ", correlation " << tile.correlation << " and "
                                    << tile.best_correlation;
      } else if (left > 82.0) {
        ++in_place;
        EXPECT_FALSE(tile.disagrees) << tile.center_px.transpose();
        EXPECT_LT(tile.displacement_mm.norm(), 1.0) << tile.center_px.transpose();
      }
    }
    EXPECT_GT(moved, 4);
    EXPECT_GT(in_place, 4);
    EXPECT_EQ(views[0].disagreeing() > 0, true);
    EXPECT_EQ(views[1].disagreeing(), 0);  // the other view shows nothing of it
  }
}

TEST(Consistency, ALittleMotionIsNoDisagreement) {
  EXPECT_EQ(consistency_of(images_with_left_half_moved({0.7, 0.0, 0.0}))[0].disagreeing(), 0);
}

TEST(Consistency, PartsOutsideTheFieldAreNotLookedAt) {
  std::vector<FixedImage> images = images_with_left_half_moved({6.0, 0.0, 0.0});
  for (int row = 0; row < images[0].field.rows; ++row)
    for (int column = 0; column < images[0].field.columns / 2; ++column) images[0].field.at(column, row) = 0;
  const auto views = consistency_of(images);
  EXPECT_EQ(views[0].disagreeing(), 0);
  EXPECT_GT(views[0].with_signal(), 4);
  for (const ViewPart& tile : views[0].parts) EXPECT_GT(tile.center_px.x(), 80.0);
}

TEST(Consistency, PartsWithoutAnythingToSeeHaveNoSignal) {
  SceneOptions options{.shapes = {make_shape(Shape::Kind::kBox, {0, 0, 0}, Vector3d::Constant(10.0), {.water = 1.0})},
                       .photons = 3000.0};
  const RegistrationScene scene = make_scene(options);
  const auto views = regional_consistency(*scene.renderers, scene.views(), scene.planned);
  int in_air = 0;
  for (const ViewPart& tile : views[0].parts) {
    // Pixels of 2.1 mm; the box lies within 5 of them, and what is left of it without slow changes within 20 more.
    if ((tile.center_px.array() - 48.0).abs().maxCoeff() < 25.0 + 0.5 * tile.width_px) continue;
    ++in_air;
    EXPECT_FALSE(tile.has_signal) << tile.center_px.transpose() << ", " << tile.best_correlation;
  }
  EXPECT_GT(in_air, 4);
}

}  // namespace
}  // namespace isoshift::consistency_test
