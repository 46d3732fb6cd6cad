// Views that contradict each other are found, from both sides: by X-rays of a patient who moved between them, and by
// geometry that lies in one of them. What no two views can show is not.

#include "registration/quality/contradiction.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "geometry/rotation.h"
#include "registration/pose_parameters.h"
#include "registration/quality/limits.h"
#include "registration/register_views.h"
#include "tests/support/registration_scene.h"

namespace isoshift::contradiction_test {
namespace {

using Eigen::Vector3d;

constexpr double kLimitMm = limits::kMaxContradictionMm;

RegistrationScene scene_with(const Vector3d& rotation_deg, const Vector3d& translation_mm = {3.0, -2.0, 4.0}) {
  SceneOptions options{.shapes = asymmetric_body(), .pixels = 128};
  options.placement.translation_mm = translation_mm;
  options.placement.rotation_deg = rotation_deg;
  return make_scene(options);
}

// After a registration of all views from the plan.
double contradiction_mm(const RegistrationScene& scene, const std::vector<FixedImage>& images) {
  const FixedViews views{.images = images, .region = scene.everything};
  Stage coarse = fine_stage();
  coarse.initial_step_mm = 4.0;
  coarse.initial_step_rad = rad_from_deg(2.0);
  coarse.pixel_mm = coarse.voxel_mm = 4.0;
  coarse.similarity = SimilarityKind::kNcc;
  const std::vector<Stage> stages = {coarse, fine_stage()};
  const SearchResult found = search(*scene.renderers, views, scene.planned, {.stages = stages});
  const Eigen::Isometry3d pose = setup_error_from_parameters(found.parameters) * scene.planned;
  double squares = 0.0;
  for (const Contradiction& of :
       contradictions(*scene.renderers, views, scene.planned, pose, fine_stage(), Dof::kRigid).of_views)
    squares += of.mm * of.mm / static_cast<double>(images.size());
  return std::sqrt(squares);
}

const Vector3d kRotation(1.0, -1.5, 2.0);

TEST(Contradiction, ViewsOfOnePoseAgree) {
  const RegistrationScene scene = scene_with(kRotation);
  EXPECT_LT(contradiction_mm(scene, scene.images), 0.3);
}

TEST(Contradiction, APatientWhoMovedBetweenTheViewsIsSeen) {
  const RegistrationScene scene = scene_with(kRotation);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<FixedImage> images = scene.images;
    images[1] = scene_with(kRotation + 2.0 * Vector3d::Unit(axis)).images[1];
    EXPECT_GT(contradiction_mm(scene, images), kLimitMm) << "turned about axis " << axis;
  }
  std::vector<FixedImage> images = scene.images;
  images[1] = scene_with(kRotation, {3.0, 0.5, 4.0}).images[1];  // along the patient, which both views see
  EXPECT_GT(contradiction_mm(scene, images), kLimitMm);
}

TEST(Contradiction, GeometryThatLiesInOneViewIsSeen) {
  const RegistrationScene scene = scene_with(kRotation);
  const Eigen::Vector2d center = *scene.images[0].view.project(Vector3d::Zero());
  const auto with_pixels_moved = [&](const Eigen::Matrix3d& moved_from_pixel) {
    std::vector<FixedImage> images = scene.images;
    images[0].view.pixel_from_room = moved_from_pixel * images[0].view.pixel_from_room;
    return contradiction_mm(scene, images);
  };
  Eigen::Matrix3d panel = Eigen::Matrix3d::Identity();
  const Eigen::Vector2d along_y = *scene.images[0].view.project(Vector3d::UnitY()) - center;
  panel.topRightCorner<2, 1>() = 5.0 / 1.5 * along_y;  // 5 mm on the receptor
  EXPECT_GT(with_pixels_moved(panel), kLimitMm);
  const double roll = rad_from_deg(3.0);
  Eigen::Matrix3d receptor = Eigen::Matrix3d::Identity();
  receptor.topLeftCorner<2, 2>() << std::cos(roll), -std::sin(roll), std::sin(roll), std::cos(roll);
  receptor.topRightCorner<2, 1>() = center - receptor.topLeftCorner<2, 2>() * center;
  EXPECT_GT(with_pixels_moved(receptor), kLimitMm);
  Eigen::Matrix3d distance = Eigen::Matrix3d::Identity();
  distance.topLeftCorner<2, 2>() *= 1.02;
  distance.topRightCorner<2, 1>() = -0.02 * center;
  EXPECT_GT(with_pixels_moved(distance), kLimitMm);
}

// What a wrong gantry angle does: the two views would turn the patient by it against each other. A patient who moved
// along the axis between the views is no turn.
TEST(Contradiction, AGantryThatLiesInOneViewIsATurn) {
  const RegistrationScene scene = scene_with(kRotation);
  const auto turn_with = [&](const std::vector<FixedImage>& images) {
    const FixedViews views{.images = images, .region = scene.everything};
    return contradictions(*scene.renderers, views, scene.planned, scene.actual(), fine_stage(), Dof::kRigid).turn;
  };
  EXPECT_FALSE(turn_with(scene.images).is_clear());
  std::vector<FixedImage> images = scene.images;
  images[1] = scene_with(kRotation, {3.0, 0.5, 4.0}).images[1];
  EXPECT_FALSE(turn_with(images).is_clear());
  const Eigen::Isometry3d gantry(Eigen::AngleAxisd(rad_from_deg(3.0), Vector3d::UnitY()));
  images = scene.images;
  images[1].view.pixel_from_room = images[1].view.pixel_from_room * gantry.matrix();
  images[1].view.source_room_mm = gantry.inverse() * images[1].view.source_room_mm;
  const TurnBetweenViews turn = turn_with(images);
  EXPECT_TRUE(turn.is_clear());
  constexpr double kWithinDeg = 0.75;  // a view alone hardly sees it, with voxels of 2.5 mm
  EXPECT_NEAR(deg_from_rad(turn.angle_rad), 3.0, kWithinDeg);
  EXPECT_LT(deg_from_rad(turn.sigma_rad), kWithinDeg);
  ASSERT_EQ(turn.room_from_patient.size(), 2U);
  const Eigen::Isometry3d between = turn.room_from_patient[1] * turn.room_from_patient[0].inverse();
  EXPECT_NEAR(std::abs(deg_from_rad(rotation_vector(between.linear()).y())), 3.0, kWithinDeg);
}

// A gantry that is off in both views looks like a turned patient: documented, not found.
TEST(Contradiction, AGantryThatLiesInBothViewsIsNotSeen) {
  const RegistrationScene scene = scene_with(kRotation);
  const Eigen::Isometry3d turn(Eigen::AngleAxisd(rad_from_deg(2.0), Vector3d::UnitY()));
  std::vector<FixedImage> images = scene.images;
  for (FixedImage& image : images) {
    image.view.pixel_from_room = image.view.pixel_from_room * turn.matrix();
    image.view.source_room_mm = turn.inverse() * image.view.source_room_mm;
  }
  EXPECT_LT(contradiction_mm(scene, images), 0.3);
}

TEST(Contradiction, OneViewContradictsNothing) {
  const RegistrationScene scene = scene_with(kRotation);
  const FixedViews one{.images = {scene.images[0]}, .region = scene.everything};
  const Contradictions none =
      contradictions(*scene.renderers, one, scene.planned, scene.actual(), fine_stage(), Dof::kRigid);
  EXPECT_TRUE(none.of_views.empty());
  EXPECT_FALSE(none.turn.is_clear());
}

// Without derivatives it is BOBYQA that climbs, to the same places.
TEST(Contradiction, IsTheSameForARendererWithoutDerivatives) {
  const RegistrationScene scene = scene_with(kRotation);
  const RendererPyramid siddon(RendererKind::kSiddon, scene.ct, {}, std::array{Beam::kKilovoltage});
  std::vector<FixedImage> images = scene.images;
  images[1] = scene_with(kRotation + Vector3d(0, 2, 0)).images[1];
  const FixedViews views{.images = images, .region = scene.everything};
  const auto of = [&](const RendererPyramid& renderers) {
    const auto found =
        contradictions(renderers, views, scene.planned, scene.actual(), fine_stage(), Dof::kRigid).of_views;
    return std::hypot(found[0].mm, found[1].mm) / std::sqrt(2.0);
  };
  const double climbed = of(*scene.renderers), by_values = of(siddon);
  EXPECT_GT(climbed, kLimitMm);
  EXPECT_NEAR(climbed, by_values, 0.25);  // of two interpolations in voxels of 2.5 mm
}

}  // namespace
}  // namespace isoshift::contradiction_test
