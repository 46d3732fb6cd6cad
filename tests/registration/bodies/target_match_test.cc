#include "registration/bodies/target_match.h"

#include <gtest/gtest.h>

#include <random>

#include "registration/presets.h"
#include "tests/support/bent_scene.h"

namespace isoshift::target_match_test {
namespace {

using Eigen::Vector3d;

BentScene column() {
  return bent_column({{.translation_mm = {1.0, -1.0, 1.0}, .rotation_deg = {-2.0, 0.0, 0.5}},
                      {.translation_mm = {1.0, -1.0, 0.5}, .rotation_deg = {-0.5, 0.5, 0.0}},
                      {.translation_mm = {1.5, -1.0, 0.0}, .rotation_deg = {1.5, -1.0, 0.5}}});
}

// Around the isocenter, with every body off its true place by as much.
TargetMatch match_at(const BentScene& scene, const Vector3d& off_room_mm) {
  const SearchableScene searchable(scene, scene.bodies, scene.planned);
  BodyPoses poses;
  for (const Eigen::Isometry3d& truth : scene.truth)
    poses.emplace_back(scene.images.size(), Eigen::Translation3d(off_room_mm) * truth * scene.planned);
  return match_near_target(searchable.get(), Vector3d::Zero(), poses);
}

TEST(TargetMatch, TellsTheRightPlaceFromOthers) {
  const BentScene scene = column();
  const TargetMatch right = match_at(scene, Vector3d::Zero()), wrong = match_at(scene, {0.0, 12.0, 0.0});
  EXPECT_GT(right.of_most_within_40_mm, 0.9);
  EXPECT_GT(right.of_most_within_20_mm, 0.9);
  EXPECT_GT(right.of_all, 0.9);
  EXPECT_GT(right.of_parts, 0.95);
  EXPECT_LT(wrong.of_most_within_40_mm, 0.8);
  EXPECT_LT(wrong.of_most_within_20_mm, 0.7);
  EXPECT_LT(wrong.of_all, 0.7);
  EXPECT_LT(wrong.of_parts, 0.7);
}

// From where most of a bent patient lies, to where the target does.
TEST(PlaceWantedNearTarget, IsThatOfTheTarget) {
  const BentScene scene = column();
  const RendererPyramid renderers(RendererKind::kCpu, scene.ct, {}, std::array{Beam::kKilovoltage});
  const auto off_mm = [&](const Eigen::Isometry3d& setup_error) {
    const auto wanted = place_wanted_near_target(renderers, scene.views(), setup_error * scene.planned,
                                                 setup_error * Vector3d::Zero(), {.stages = preset("setup").stages});
    return wanted ? (*wanted - scene.truth[1] * Vector3d::Zero()).norm() : 1e9;
  };
  EXPECT_LT(off_mm(scene.truth[1]), 0.5);  // voxels of 2 mm, and neighbors that have moved
  EXPECT_LT(off_mm(Eigen::Translation3d(0.0, 2.0, -1.0) * scene.truth[1]), 0.5);
}

// Fluid whose level runs through the surroundings: one strong edge that the CT does not have.
TEST(TargetMatch, IsHardlySpoiledByContrastThatHasChanged) {
  BentScene scene = column();
  for (FixedImage& image : scene.images)
    for (int row = 0; row < image.line_integral.rows; ++row)
      for (int column = 0; column < image.line_integral.columns; ++column)
        if (column > image.line_integral.columns / 2 + row / 8) image.line_integral.at(row, column) += 4.0F;
  const TargetMatch match = match_at(scene, Vector3d::Zero());
  EXPECT_LT(match.of_all, 0.7);
  EXPECT_GT(match.of_parts, 0.8);
  EXPECT_GT(match.of_most_within_40_mm, 0.9);
  EXPECT_GT(match.of_most_within_20_mm, 0.7);
  const TargetMatch wrong = match_at(scene, {0.0, 12.0, 0.0});
  EXPECT_LT(wrong.of_parts, 0.7);
  EXPECT_LT(wrong.of_most_within_40_mm, 0.8);
}

// Gradients that a DRR has, and an X-ray that has them, too, with other contrast and some noise, but for the first
// ones.
TEST(TargetMatch, CorrelationOfMostLeavesOutWhatAgreesLeast) {
  std::mt19937 random(7);
  std::normal_distribution<float> normal;
  constexpr std::size_t kPlaces = 2000;
  const auto correlation_with_other = [&](double share) {
    Gradients xray, drr;
    for (std::size_t n = 0; n < kPlaces; ++n) {
      const bool is_other = static_cast<double>(n) < share * kPlaces;
      for (const auto direction : {&Gradients::along_row, &Gradients::along_column}) {
        const float here = normal(random);
        (drr.*direction).push_back(here);
        (xray.*direction).push_back(is_other ? 5.0F * normal(random) : 2.0F * here + 0.2F * normal(random));
      }
    }
    return trimmed_correlation(xray, drr);
  };
  // Noise alone: 2 / sqrt(2^2 + 0.2^2) = 0.995, or a little more, as the noisiest 30 % are left out.
  EXPECT_NEAR(correlation_with_other(0.0), 0.997, 0.003);
  EXPECT_GT(correlation_with_other(0.25), 0.99);
  EXPECT_LT(correlation_with_other(0.5), 0.9);
  EXPECT_LT(correlation_with_other(1.0), 0.5);
}

TEST(TargetMatch, CorrelationOfMostIsZeroWhereNothingIsSeen) {
  const Gradients flat{std::vector<float>(100, 1.0F), std::vector<float>(100, 2.0F)};
  Gradients edge = flat;
  edge.along_row[50] = 3.0F;
  EXPECT_EQ(trimmed_correlation(flat, edge), 0.0);
  EXPECT_EQ(trimmed_correlation(edge, flat), 0.0);
}

TEST(TargetMatch, OfAWholeIsThatOfBodiesThatDidNotMoveApart) {
  const BentScene scene = bent_column(std::vector<MovedGroup>(3, {.translation_mm = {1.0, -2.0, 0.5}}));
  const FixedViews views = scene.views();
  const RenderedBodies rendered = rendered_bodies(scene, scene.bodies);
  const TargetMatch bodies = match_at(scene, Vector3d::Zero());
  const CoarseMatch whole =
      match_near_target(views, *rendered.as_one, scene.truth[1] * scene.planned, Vector3d::Zero());
  EXPECT_NEAR(whole.of_all, bodies.of_all, 0.02);
  EXPECT_NEAR(whole.of_parts, bodies.of_parts, 0.02);
  EXPECT_GT(whole.of_all, 0.9);
}

}  // namespace
}  // namespace isoshift::target_match_test
