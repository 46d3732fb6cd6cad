#include "registration/search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "geometry/rotation.h"
#include "registration/pose_parameters.h"
#include "tests/support/pose_near.h"
#include "tests/support/registration_scene.h"

namespace isoshift::search_test {
namespace {

using Eigen::Vector3d;

RegistrationScene scene_with(const Vector3d& translation_mm, const Vector3d& rotation_deg) {
  SceneOptions options{.shapes = asymmetric_body()};
  options.placement.translation_mm = translation_mm;
  options.placement.rotation_deg = rotation_deg;
  return make_scene(options);
}

const RegistrationScene& near_scene() {
  static const RegistrationScene scene = scene_with({3.0, -2.0, 4.0}, {1.0, -1.5, 2.0});
  return scene;
}

Stage coarse_stage() {
  return {.name = "coarse",
          .pixel_mm = 5.0,
          .voxel_mm = 5.0,
          .initial_step_mm = 3.0,
          .initial_step_rad = rad_from_deg(2.0),
          .relative_tolerance = 0.02};
}

SearchResult search_in(const RegistrationScene& scene, std::vector<Stage> stages, SearchOptions options = {}) {
  options.stages = stages;
  return search(*scene.renderers, scene.views(), scene.planned, options);
}

Eigen::Isometry3d found_in(const SearchResult& result) { return setup_error_from_parameters(result.parameters); }

TEST(Search, FindsANearPoseWithoutCandidates) {
  const SearchResult result = search_in(near_scene(), {coarse_stage()});
  EXPECT_THAT(found_in(result), PoseNear(near_scene().truth, 1.0, 1.0));
  ASSERT_EQ(result.stages.size(), 1U);
  EXPECT_EQ(result.stages[0].name, "coarse");
  EXPECT_EQ(result.stages[0].similarity, to_string(coarse_stage().similarity));
  EXPECT_GT(result.stages[0].evaluations, 10);
  EXPECT_FALSE(result.stages[0].reached_limit);
  EXPECT_NE(result.stages[0].termination, "not run");
}

TEST(Search, CandidatesFindAPoseThatALocalSearchMisses) {
  const RegistrationScene far = scene_with({5.0, -4.0, 3.0}, {75.0, -60.0, 68.0});
  Stage local = coarse_stage();
  local.similarity = SimilarityKind::kGradientCorrelation;
  Stage wide = local;
  wide.candidates = 2000;
  wide.starts = 8;
  wide.reach_mm = 8.0;
  wide.reach_rad = rad_from_deg(65.0);
  const SearchOptions options{.bound_rad = rad_from_deg(120.0)};
  EXPECT_THAT(found_in(search_in(far, {local}, options)), testing::Not(PoseNear(far.truth, 5.0, 5.0)));
  const SearchResult found = search_in(far, {wide}, options);
  EXPECT_THAT(found_in(found), PoseNear(far.truth, 2.0, 4.0));  // in pixels of 5 mm
  EXPECT_GT(found.stages[0].evaluations, wide.candidates);      // all of them, and then the searches
}

TEST(Search, EveryStageBeginsWhereTheLastEnded) {
  Stage fine = coarse_stage();
  fine.name = "fine";
  fine.similarity = SimilarityKind::kGradientCorrelation;
  fine.pixel_mm = 2.1;
  fine.voxel_mm = 2.5;
  fine.initial_step_mm = 0.5;
  fine.initial_step_rad = rad_from_deg(0.4);
  const SearchResult both = search_in(near_scene(), {coarse_stage(), fine});
  EXPECT_THAT(found_in(both), PoseNear(near_scene().truth, 0.3, 0.3));
  ASSERT_EQ(both.stages.size(), 2U);
  EXPECT_EQ(both.stages[1].name, "fine");
  // In two calls: the same.
  const SearchResult first = search_in(near_scene(), {coarse_stage()});
  const SearchResult second = search_in(near_scene(), {fine}, {.parameters = first.parameters});
  EXPECT_EQ(second.parameters, both.parameters);
}

TEST(Search, SpreadIsReportedForSeveralStarts) {
  const SearchResult one = search_in(near_scene(), {coarse_stage()});
  EXPECT_FALSE(one.stages[0].spread_mm);
  EXPECT_FALSE(one.stages[0].spread_rad);

  Stage several = coarse_stage();
  several.candidates = 2;
  several.starts = 3;
  several.reach_mm = 3.0;
  several.reach_rad = rad_from_deg(2.0);
  const SearchResult agreeing = search_in(near_scene(), {several});
  ASSERT_TRUE(agreeing.stages[0].spread_mm && agreeing.stages[0].spread_rad);
  EXPECT_LT(*agreeing.stages[0].spread_mm, 1.5);
  EXPECT_LT(*agreeing.stages[0].spread_rad, rad_from_deg(2.0));

  // Several that go on to the next stage may differ, and the next stage begins with them.
  several.keep = 2;
  Stage next = coarse_stage();
  const SearchResult kept = search_in(near_scene(), {several, next});
  EXPECT_FALSE(kept.stages[0].spread_mm);
  EXPECT_TRUE(kept.stages[1].spread_mm);
}

TEST(Search, SpreadIsOfPosesThatMatchAsWell) {
  // A ball, turned any way, looks the same.
  SceneOptions options{
      .shapes = {make_shape(Shape::Kind::kEllipsoid, {0, 0, 0}, Vector3d::Constant(50.0), {.water = 1.0})}};
  const RegistrationScene ball = make_scene(options);
  Stage several = coarse_stage();
  several.candidates = 2;
  several.starts = 3;
  several.reach_mm = 1.0;
  several.reach_rad = rad_from_deg(15.0);
  several.initial_step_rad = rad_from_deg(0.1);
  const SearchResult undecided = search_in(ball, {several});
  ASSERT_TRUE(undecided.stages[0].spread_rad);
  EXPECT_GT(*undecided.stages[0].spread_rad, rad_from_deg(2.0));
  EXPECT_LT(*undecided.stages[0].spread_mm, 1.0);

  // Where anatomy tells them apart, those that were left behind do not count.
  several.max_evaluations = 20;
  several.reach_mm = 25.0;
  several.reach_rad = rad_from_deg(20.0);
  EXPECT_LT(*search_in(near_scene(), {several}).stages[0].spread_mm, 1.0);
}

TEST(Search, SameSeedSameResult) {
  Stage stage = coarse_stage();
  stage.similarity = SimilarityKind::kStochasticRankCorrelation;
  stage.pixel_fraction = 0.3;
  stage.min_pixels = 200;
  stage.candidates = 10;
  stage.starts = 2;
  stage.reach_mm = 5.0;
  stage.reach_rad = rad_from_deg(3.0);
  const SearchResult first = search_in(near_scene(), {stage}, {.seed = 3});
  const SearchResult again = search_in(near_scene(), {stage}, {.seed = 3});
  const SearchResult other = search_in(near_scene(), {stage}, {.seed = 4});
  EXPECT_EQ(again.parameters, first.parameters);
  EXPECT_EQ(again.stages[0].value, first.stages[0].value);
  EXPECT_EQ(again.stages[0].evaluations, first.stages[0].evaluations);
  EXPECT_NE(other.parameters, first.parameters);
}

// From the same near start with every similarity: where BOBYQA ends, or nearer, in fewer evaluations.
struct OnDerivatives {
  OptimizerKind optimizer;
  SimilarityKind similarity;
};
class SearchOnDerivatives : public testing::TestWithParam<OnDerivatives> {};
INSTANTIATE_TEST_SUITE_P(
    All, SearchOnDerivatives,
    testing::Values(OnDerivatives{OptimizerKind::kLevenbergMarquardt, SimilarityKind::kNcc},
                    OnDerivatives{OptimizerKind::kLevenbergMarquardt, SimilarityKind::kGradientCorrelation},
                    OnDerivatives{OptimizerKind::kLevenbergMarquardt, SimilarityKind::kStochasticRankCorrelation},
                    OnDerivatives{OptimizerKind::kLbfgs, SimilarityKind::kStochasticRankCorrelation},
                    OnDerivatives{OptimizerKind::kLbfgs, SimilarityKind::kMutualInformation},
                    OnDerivatives{OptimizerKind::kLbfgs, SimilarityKind::kNormalizedMutualInformation}),
    [](const auto& of) {
      std::string name = std::string(to_string(of.param.optimizer)) + "_" + std::string(to_string(of.param.similarity));
      std::ranges::replace(name, '-', '_');
      return name;
    });

TEST_P(SearchOnDerivatives, EndsWhereBobyqaEnds) {
  Stage stage = coarse_stage();
  stage.similarity = GetParam().similarity;
  stage.pixel_mm = stage.voxel_mm = 2.5;
  stage.initial_step_mm = 1.0;
  stage.initial_step_rad = rad_from_deg(0.6);
  const std::vector<double> start = {2.2, -1.4, 4.7, 1.5, -2.0, 3.0};
  const SearchResult by_values = search_in(near_scene(), {stage}, {.parameters = start});
  stage.optimizer = GetParam().optimizer;
  const SearchResult found = search_in(near_scene(), {stage}, {.parameters = start});
  EXPECT_EQ(found.stages[0].optimizer, to_string(GetParam().optimizer));
  EXPECT_GT(found.stages[0].value, by_values.stages[0].value - 0.002);
  EXPECT_LT(found.stages[0].evaluations, by_values.stages[0].evaluations);
  EXPECT_THAT(found_in(found), PoseNear(near_scene().truth, 0.8, 0.8));
}

TEST(Search, WithoutDerivativesAClimbIsBobyqas) {
  const RegistrationScene& scene = near_scene();
  Stage stage = coarse_stage();
  stage.similarity = SimilarityKind::kGradientCorrelation;
  const RendererPyramid siddon(RendererKind::kSiddon, scene.ct, {}, std::array{Beam::kKilovoltage});
  const auto end = [&](OptimizerKind optimizer) {
    stage.optimizer = optimizer;
    return search(siddon, scene.views(), scene.planned, {.stages = {stage}});
  };
  const SearchResult climbed = end(OptimizerKind::kLevenbergMarquardt);
  EXPECT_EQ(climbed.stages[0].optimizer, "bobyqa");
  EXPECT_EQ(climbed.parameters, end(OptimizerKind::kBobyqa).parameters);
}

TEST(Search, StaysWithinItsBounds) {
  // The truth lies outside of them, along every axis.
  const RegistrationScene scene = scene_with({6.0, -6.0, 6.0}, {4.0, -4.0, 4.0});
  Stage stage = coarse_stage();
  stage.initial_step_mm = 1.0;
  stage.initial_step_rad = rad_from_deg(0.6);
  for (const int candidates : {0, 30}) {
    stage.candidates = candidates;
    stage.reach_mm = 20.0;
    stage.reach_rad = rad_from_deg(10.0);
    const SearchResult result = search_in(scene, {stage}, {.bound_mm = 3.0, .bound_rad = rad_from_deg(1.5)});
    for (std::size_t axis = 0; axis < 6; ++axis) {
      const double bound = axis < 3 ? 3.0 : rad_from_deg(1.5) * kLeverMm;
      EXPECT_LE(std::abs(result.parameters[axis]), bound + 1e-9) << axis;
    }
    const auto at_bound = std::ranges::count_if(result.parameters, [](double p) { return std::abs(p) > 2.5; });
    EXPECT_GE(at_bound, 2) << testing::PrintToString(result.parameters);
  }
}

TEST(Search, OfTranslationsLeavesRotationsAlone) {
  const SearchResult result = search_in(near_scene(), {coarse_stage()}, {.dof = Dof::kTranslation});
  EXPECT_EQ(result.parameters.size(), 3U);
  EXPECT_TRUE(found_in(result).linear().isIdentity(0.0));
  EXPECT_THAT(found_in(result), PoseNear(near_scene().truth, 2.5, 5.0));
}

TEST(Search, ProgressGoesFromStageToStageUpToOne) {
  std::vector<double> shares;
  const std::vector<Stage> stages = {coarse_stage(), coarse_stage(), coarse_stage()};
  search(*near_scene().renderers, near_scene().views(), near_scene().planned, {.stages = stages},
         [&](double share) { shares.push_back(share); });
  ASSERT_FALSE(shares.empty());
  EXPECT_TRUE(std::ranges::is_sorted(shares));
  EXPECT_DOUBLE_EQ(shares.back(), 1.0);
  EXPECT_GT(shares.front(), 0.0);
}

int field_pixels(const FixedImage& image) { return static_cast<int>(std::ranges::count(image.field.pixels, 1)); }

TEST(FixedViews, AreReducedToThePixelsAskedFor) {
  const FixedViews views = near_scene().views();
  const double finest_mm = 1.0 / pixels_per_mm(views.images[0].view);
  for (const double pixel_mm : {0.1, 1.05 * finest_mm, 2.05 * finest_mm, 2.9 * finest_mm}) {
    const FixedImage level = views.reduced_to(pixel_mm, near_scene().planned, 0.0)[1];
    const double of_level_mm = 1.0 / pixels_per_mm(level.view);
    EXPECT_LE(of_level_mm, std::max(pixel_mm, finest_mm) * 1.001);
    EXPECT_GT(of_level_mm, 0.65 * pixel_mm);
    EXPECT_EQ(level.view.columns, level.field.columns);
  }
}

TEST(FixedViews, KeepSmallFieldsResolved) {
  FixedViews views = near_scene().views();
  FixedImage& small = views.images[0];
  for (int row = 0; row < small.field.rows; ++row)
    for (int column = 0; column < small.field.columns; ++column)
      if (std::abs(column - 48) > 18 || std::abs(row - 48) > 18) small.field.at(column, row) = 0;
  const auto level = views.reduced_to(10.0, near_scene().planned, 0.0);
  // Pixels of 10 mm would leave 60; the other view, with a field of 90 x 90 pixels, is reduced.
  EXPECT_GT(field_pixels(level[0]), 500);
  EXPECT_LT(level[1].view.columns, views.images[1].view.columns);
  EXPECT_GT(field_pixels(level[1]), 500);
}

}  // namespace
}  // namespace isoshift::search_test
