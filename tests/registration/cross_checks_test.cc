#include "registration/quality/cross_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "geometry/rotation.h"
#include "tests/support/registration_scene.h"

namespace isoshift::cross_checks_test {
namespace {

using Eigen::Vector3d;

SceneOptions three_views(const Vector3d& translation_mm) {
  SceneOptions options{.shapes = asymmetric_body(), .gantry_angles_deg = {0.0, 60.0, 120.0}};
  options.placement.translation_mm = translation_mm;
  return options;
}

std::vector<LeftOutView> left_out_of(const RegistrationScene& scene) {
  const Stage stage = fine_stage();
  const SearchOptions options{.stages = {stage}};
  const SearchResult found = search(*scene.renderers, scene.views(), scene.planned, options);
  return leave_out_views(*scene.renderers, scene.views(), scene.planned, options, found);
}

TEST(LeaveOutViews, ViewsThatAgreeCanBeSpared) {
  const auto left_out = left_out_of(make_scene(three_views({0.5, -0.4, 0.3})));
  ASSERT_EQ(left_out.size(), 3U);
  for (const LeftOutView& view : left_out) {
    EXPECT_LT(view.distance_mm, 0.4);
    EXPECT_LT(view.angle_rad, rad_from_deg(1.0));
  }
}

TEST(LeaveOutViews, AViewTakenAfterThePatientMovedPullsThePose) {
  RegistrationScene scene = make_scene(three_views(Vector3d::Zero()));
  scene.images[1] = prepare(xrays_of(three_views({0.0, 4.0, 0.0}))[1]);  // along the gantry's axis: seen by all views
  const auto left_out = left_out_of(scene);
  ASSERT_EQ(left_out.size(), 3U);
  EXPECT_GT(left_out[1].distance_mm, 0.7);
}

TEST(LeaveOutViews, TwoViewsAreBothNeeded) {
  SceneOptions options = three_views(Vector3d::Zero());
  options.gantry_angles_deg = {0.0, 90.0};
  EXPECT_TRUE(left_out_of(make_scene(options)).empty());
}

// Vertebrae 30 mm apart and all the same, but for a rib at one of them.
std::vector<Shape> alike_vertebrae() {
  std::vector<Shape> shapes = {make_shape(Shape::Kind::kCylinder, {0, 0, 0}, {50, 40, 200}, {.water = 1.0})};
  for (int n = -6; n <= 6; ++n) {
    shapes.push_back(make_shape(Shape::Kind::kEllipsoid, {0, 5, 30.0 * n}, {18, 14, 11}, {.water = -0.5, .bone = 0.5}));
    shapes.push_back(make_shape(Shape::Kind::kBox, {0, 28, 30.0 * n - 5}, {3, 8, 6}, {.water = -0.5, .bone = 0.5}));
  }
  shapes.push_back(make_shape(Shape::Kind::kEllipsoid, {30, -5, 4}, {10, 4, 4}, {.water = -0.6, .bone = 0.6}));
  return shapes;
}

TEST(CompareVertebrae, FindsTheNextOnesOnEitherSide) {
  SceneOptions options{.shapes = alike_vertebrae()};
  options.ct_mm = Vector3d(120, 100, 300);
  const RegistrationScene scene = make_scene(options);
  const Stage stage = fine_stage();
  const SearchOptions search_options{.stages = {stage}};
  const SearchResult found = search(*scene.renderers, scene.views(), scene.planned, search_options);
  const auto alternatives = compare_vertebrae(*scene.renderers, scene.views(), scene.planned, search_options, found);
  ASSERT_EQ(alternatives.size(), 2U);
  for (const Alternative& alternative : alternatives) {
    EXPECT_NEAR(alternative.distance_mm, 30.0, 2.0) << alternative.description;
    EXPECT_LT(alternative.similarity, alternative.as_is) << alternative.description;
    EXPECT_GT(alternative.similarity, 0.5) << alternative.description;
    EXPECT_EQ(alternative.as_is, found.stages.back().value);
  }
  EXPECT_THAT(alternatives[0].description, testing::HasSubstr("further to the feet"));
  EXPECT_THAT(alternatives[1].description, testing::HasSubstr("further to the head"));
}

TEST(CompareVertebrae, OfABodyWithoutThemIsNothingAsGood) {
  SceneOptions options{.shapes = asymmetric_body()};
  const RegistrationScene scene = make_scene(options);
  const Stage stage = fine_stage();
  const SearchOptions search_options{.stages = {stage}};
  const SearchResult found = search(*scene.renderers, scene.views(), scene.planned, search_options);
  for (const Alternative& alternative :
       compare_vertebrae(*scene.renderers, scene.views(), scene.planned, search_options, found))
    EXPECT_LT(alternative.similarity, 0.6 * alternative.as_is) << alternative.description;
}

}  // namespace
}  // namespace isoshift::cross_checks_test
