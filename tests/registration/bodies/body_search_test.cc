// Bodies are found where they are, whatever the others do, and what the images do not show is said.

#include "registration/bodies/body_search.h"

#include <gtest/gtest.h>

#include "geometry/rotation.h"
#include "registration/bodies/body_objective.h"
#include "tests/support/bent_scene.h"

namespace isoshift::body_search_test {
namespace {

using Eigen::Vector3d;

// A bent column: the truth of each vertebra is its own.
BentScene bent() {
  return bent_column({{.translation_mm = {1.0, -2.0, 1.5}, .rotation_deg = {-3.0, 1.0, 0.5}},
                      {.translation_mm = {2.0, -1.0, 0.5}, .rotation_deg = {-0.5, 0.5, 1.0}},
                      {.translation_mm = {2.5, -1.0, 0.0}, .rotation_deg = {2.0, -1.0, 1.5}}});
}

struct Searched {
  BodyPoses poses;
  BodyCertainty certainty;
};

// Of the farthest of the points, 26 mm from a body's center, with voxels of 2 mm. Tiles that all weigh the same,
// however faint they are, cost 0.15 mm of it here, where nothing but bodies moves (docs/algorithms.md, "Bodies that
// bend").
constexpr double kFarthestMm = 1.0;

// How far the search puts a group's center, and points 15 mm around it, from where they are: the farthest.
double error_mm(const BentScene& scene, std::size_t group, const Searched& found) {
  const Eigen::Isometry3d error = found.poses[group].front() * scene.planned.inverse();
  const double z = 36.0 * (static_cast<double>(group) - 0.5 * static_cast<double>(scene.truth.size() - 1));
  double farthest = 0.0;
  for (int n = 0; n < 27; ++n) {
    const Vector3d patient = Vector3d(0, 0, z) + 15.0 * Vector3d(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
    const Vector3d planned = scene.planned * patient;
    farthest = std::max(farthest, (error * planned - scene.truth[group] * planned).norm());
  }
  return farthest;
}

Searched search_from(const BentScene& scene, const Vector3d& offset_mm, const JointedBodies& bodies) {
  const SearchableScene searchable(scene, bodies, Eigen::Translation3d(offset_mm) * scene.planned);
  const BodyScene& searched = searchable.get();
  const BodySearchOptions options;
  const BodyPoses start = at_one_pose(searched, searched.whole_room_from_patient);
  const BodyPoses poses = search_bodies(searched, start, options.stages, options.bound_mm).poses;
  return {.poses = poses, .certainty = certainty_of(searched, poses, options.stages.back())};
}

// One sigma of where a body's isocenter lies.
double sigma_mm(const Searched& found, std::size_t body) {
  const auto at = static_cast<Eigen::Index>(6 * body);
  return std::sqrt(found.certainty.covariance.block<3, 3>(at, at).trace());
}

double share_of_images(const Searched& found, std::size_t body) {
  const auto at = static_cast<Eigen::Index>(6 * body);
  return image_share(found.certainty.covariance.block<3, 3>(at, at),
                     found.certainty.covariance_on_loose_springs.block<3, 3>(at, at));
}

TEST(BodySearch, FindsEveryBodyOfABentColumn) {
  const BentScene scene = bent();
  for (const Vector3d& offset : {Vector3d(0, 0, 0), Vector3d(4, -3, 2)}) {
    const Searched found = search_from(scene, offset, scene.bodies);
    for (std::size_t group = 0; group < 3; ++group) {
      EXPECT_LT(error_mm(scene, group, found), kFarthestMm) << "group " << group << " from " << offset.transpose();
      EXPECT_GT(share_of_images(found, group), 0.5);
      // Sigmas are of the size of the errors, in the room about the isocenter.
      EXPECT_LT(sigma_mm(found, group), 3.0);
    }
  }
}

TEST(BodySearch, ABodyWithoutImagesIsLeftToItsSprings) {
  BentScene scene = bent();
  // The rows of both views that show the highest vertebra.
  for (FixedImage& image : scene.images)
    for (int row = 0; row < image.field.rows; ++row)
      for (int column = 0; column < image.field.columns; ++column) {
        const auto top = image.view.project(scene.planned * Vector3d(0, 0, 16.0));
        const auto bottom = image.view.project(scene.planned * Vector3d(0, 0, -100.0));
        if ((row < top->y()) == (top->y() < bottom->y())) image.field.at(column, row) = 0;
      }
  const Searched found = search_from(scene, {0, 0, 0}, scene.bodies);
  EXPECT_LT(share_of_images(found, 2), 0.2);
  EXPECT_GT(share_of_images(found, 1), 0.5);
  EXPECT_LT(error_mm(scene, 0, found), kFarthestMm);
  EXPECT_LT(error_mm(scene, 1, found), kFarthestMm);
}

TEST(BodySearch, ABodyThatBreathesHasAPosePerView) {
  // The highest vertebra lies elsewhere in each view: its X-rays are of two scenes.
  const auto column = [](const Vector3d& highest) {
    return bent_column(
        {{.translation_mm = {1.0, -2.0, 1.5}}, {.translation_mm = {1.0, -2.0, 1.0}}, {.translation_mm = highest}});
  };
  BentScene scene = column({1.0, -2.0, 4.0});
  scene.images[1] = column({1.0, 2.5, 0.0}).images[1];
  JointedBodies bodies = scene.bodies;
  bodies.bodies[2].breathes = true;
  bodies.springs[1].sigma_mm = 5.0;
  const Searched found = search_from(scene, {0, 0, 0}, bodies);
  EXPECT_LT(error_mm(scene, 1, found), kFarthestMm);
  const Vector3d middle = scene.planned * Vector3d(0, 0, 36.0);
  const auto moved = [&](std::size_t view) -> Vector3d {
    return found.poses[2][view] * scene.planned.inverse() * middle - middle;
  };
  EXPECT_NEAR(moved(0).y(), -2.0, 0.8);  // along the patient, which both views see
  EXPECT_NEAR(moved(1).y(), 2.5, 0.8);
  EXPECT_EQ(found.poses[1][0].matrix(), found.poses[1][1].matrix());
}

// The model's gradient is that of its value, springs included.
TEST(BodyObjective, GradientsAreDifferencesOfTheValue) {
  const BentScene scene = bent();
  JointedBodies bodies = scene.bodies;
  bodies.bodies[0].breathes = true;
  const BodyRenderers renderers(RendererKind::kCpu, scene.ct, {}, std::array{Beam::kKilovoltage}, bodies.shares);
  const auto whole = make_renderer(RendererKind::kCpu, scene.ct, {}, std::array{Beam::kKilovoltage});
  const std::vector<FixedImage> images = scene.views().reduced_to(3.0, scene.planned, 5.0);
  const Objective pixels(*whole, images, scene.planned, {.similarity = SimilarityKind::kGradientCorrelation});
  BodyObjective objective(bodies, renderers, pixels, 25.0);
  const BodyPoses planned(3, std::vector<Eigen::Isometry3d>(2, scene.planned));
  const PoseSlots slots(bodies, renderers, planned);
  ASSERT_EQ(slots.count(), 4U);
  std::vector<double> at(24);
  for (std::size_t n = 0; n < at.size(); ++n) at[n] = 0.4 * std::sin(static_cast<double>(n));
  const QuadraticModel model = objective.model(slots, at);
  for (std::size_t n = 0; n < at.size(); ++n) {
    constexpr double kStep = 0.1;
    std::vector<double> before = at, behind = at;
    before[n] -= kStep;
    behind[n] += kStep;
    const double expected =
        (objective.model(slots, behind).value - objective.model(slots, before).value) / (2.0 * kStep);
    const double slope = model.gradient[static_cast<Eigen::Index>(n)];
    EXPECT_NEAR(slope, expected, 0.1 * std::abs(expected) + 0.3) << "parameter " << n;
  }
  EXPECT_LE(objective.parts(slots, at).of_all_views().curvature.trace(), model.curvature.trace());
}

}  // namespace
}  // namespace isoshift::body_search_test
