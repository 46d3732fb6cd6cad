#include "registration/quality/uncertainty.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/rotation.h"
#include "registration/pose_parameters.h"
#include "registration/presets.h"
#include "registration/register_views.h"
#include "tests/drr/test_views.h"
#include "tests/support/plain_renderer.h"
#include "tests/support/registration_scene.h"

namespace isoshift::uncertainty_test {
namespace {

using Eigen::Vector3d;

SceneOptions small_scene(double photons, std::uint64_t seed = 1) {
  SceneOptions options{.shapes = asymmetric_body(), .photons = photons, .seed = seed};
  options.placement.translation_mm = Vector3d(1.0, -0.5, 0.8);
  options.placement.rotation_deg = Vector3d(0.5, -0.4, 0.6);
  return options;
}

Objective gradient_correlation(const RegistrationScene& scene) {
  return {
      scene.renderers->finest(), scene.images, scene.actual(), {.similarity = SimilarityKind::kGradientCorrelation}};
}

std::optional<Uncertainty> uncertainty_at_truth(const RegistrationScene& scene, bool translation_only = false) {
  Objective objective = gradient_correlation(scene);
  return estimated_uncertainty(objective, scene.actual(),
                               {.translation_only = translation_only, .voxel_mm = scene.renderers->voxel_mm()});
}

TEST(Uncertainty, MoreNoiseMakesEveryAxisLessCertain) {
  const auto quiet = uncertainty_at_truth(make_scene(small_scene(5000.0)));
  const auto noisy = uncertainty_at_truth(make_scene(small_scene(50.0)));
  ASSERT_TRUE(quiet && noisy);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(quiet->sigma_translation_mm()[axis], 0.0);
    EXPECT_GT(quiet->sigma_rotation_rad()[axis], 0.0);
    EXPECT_GT(noisy->sigma_translation_mm()[axis], 1.5 * quiet->sigma_translation_mm()[axis]) << axis;
    EXPECT_GT(noisy->sigma_rotation_rad()[axis], 1.5 * quiet->sigma_rotation_rad()[axis]) << axis;
  }
}

TEST(Uncertainty, IsTheSameFromDerivativesAndFromDifferences) {
  const RegistrationScene scene = make_scene(small_scene(1000.0));
  PlainRenderer plain(scene.renderers->finest());
  const auto sigmas_of = [&](Renderer& renderer) {
    Objective objective(renderer, scene.images, scene.actual(), {.similarity = SimilarityKind::kGradientCorrelation});
    const Uncertainty said = estimated_uncertainty(objective, scene.actual(), {}).value();
    Eigen::Matrix<double, 6, 1> sigmas;
    sigmas << said.sigma_translation_mm(), said.sigma_rotation_rad();
    return sigmas;
  };
  const auto by_derivatives = sigmas_of(scene.renderers->finest()), by_differences = sigmas_of(plain);
  for (int axis = 0; axis < 6; ++axis)
    EXPECT_NEAR(by_derivatives[axis] / by_differences[axis], 1.0, 0.1) << "axis " << axis;
}

// The truth known, the pose found in many draws of the noise: how far it lies off, and what was said about that.
TEST(Uncertainty, SaysHowFarOffNoisyRegistrationsEnd) {
  constexpr int kDraws = 24;
  constexpr double kPhotons = 100.0;  // noise that errors of the model do not hide
  RegistrationScene scene = make_scene(small_scene(kPhotons));
  const Stage stage{.name = "fine",
                    .similarity = SimilarityKind::kGradientCorrelation,
                    .pixel_mm = 0.1,
                    .initial_step_mm = 0.5,
                    .initial_step_rad = rad_from_deg(0.3),
                    .relative_tolerance = 0.02};
  Eigen::Matrix<double, 6, 1> squares = Eigen::Matrix<double, 6, 1>::Zero(), sigma = squares;
  for (std::uint64_t seed = 1; seed <= kDraws; ++seed) {
    scene.xrays = xrays_of(small_scene(kPhotons, seed));
    scene.images.clear();
    for (const XrayImage& xray : scene.xrays) scene.images.push_back(prepare(xray));
    const SearchResult found = search(*scene.renderers, scene.views(), scene.actual(), {.stages = {stage}});
    const Eigen::Isometry3d error = setup_error_from_parameters(found.parameters);
    const Eigen::AngleAxisd turn(error.linear());
    Eigen::Matrix<double, 6, 1> off;
    off << error.translation(), turn.angle() * turn.axis();
    squares += off.cwiseAbs2() / kDraws;
    Objective objective = gradient_correlation(scene);
    const auto said = estimated_uncertainty(objective, error * scene.actual(),
                                            {.translation_only = false, .voxel_mm = scene.renderers->voxel_mm()});
    ASSERT_TRUE(said);
    Eigen::Matrix<double, 6, 1> of_draw;
    of_draw << said->sigma_translation_mm(), said->sigma_rotation_rad();
    sigma += of_draw / kDraws;
  }
  for (int axis = 0; axis < 6; ++axis) {
    const double rms = std::sqrt(squares[axis]);
    RecordProperty("ratio_" + std::to_string(axis), std::to_string(sigma[axis] / rms));
    EXPECT_LT(sigma[axis], 3.0 * rms) << "axis " << axis << ": rms error " << rms;
    EXPECT_GT(sigma[axis], rms / 3.0) << "axis " << axis << ": rms error " << rms;
  }
}

// Turning a ball does not change its shadow.
TEST(Uncertainty, OfABallIsNotAccepted) {
  SceneOptions options{
      .shapes = {make_shape(Shape::Kind::kEllipsoid, {0, 0, 0}, Vector3d::Constant(50.0), {.water = 1.0})},
      .photons = 300.0};
  for (const Vector3d& turned_deg : {Vector3d(3.0, -2.0, 4.0), Vector3d(-5.0, 1.0, 2.0), Vector3d(0.5, -6.0, -3.0)}) {
    options.placement.rotation_deg = turned_deg;
    options.placement.translation_mm = Vector3d(2.0, -3.0, 1.0);
    const RegistrationScene scene = make_scene(options);
    const RegistrationResult result =
        register_views(*scene.renderers, prepared(scene.xrays), scene.planned, preset("setup"));
    EXPECT_NE(result.verdict(), Verdict::kAccepted);
    ASSERT_TRUE(result.uncertainty);
    EXPECT_GT(result.uncertainty->sigma_rotation_rad().minCoeff(), rad_from_deg(0.5));
  }
}

TEST(Uncertainty, IsAtLeastAQuarterOfTheSpreadOfRestarts) {
  const Uncertainty curvature = uncertainty_of_independent_axes({0.1, 0.2, 0.2}, {0.003, 0.0, 0.004});
  const Uncertainty widened = widened_to_spread(curvature, /*spread_mm=*/1.0, /*spread_rad=*/0.2);
  EXPECT_EQ(widened.sigma_translation_mm(), curvature.sigma_translation_mm());  // 0.3 mm in all: four sigma are 1.2 mm
  EXPECT_NEAR(widened.sigma_rotation_rad().norm(), 0.05, 1e-12);
  EXPECT_NEAR(widened.sigma_rotation_rad().x() / widened.sigma_rotation_rad().z(), 0.75, 1e-12);
  // No point becomes more certain, also where translation and rotation go together.
  Uncertainty about_a_point = uncertainty_of_independent_axes({0.1, 0.1, 0.1}, {0.003, 0.003, 0.003});
  Eigen::Matrix<double, 6, 6> moved = Eigen::Matrix<double, 6, 6>::Identity();
  moved.topRightCorner<3, 3>() = cross_matrix({0, 100, 0});
  about_a_point.covariance = moved * about_a_point.covariance * moved.transpose();
  const Uncertainty wider = widened_to_spread(about_a_point, /*spread_mm=*/0.0, /*spread_rad=*/0.1);
  for (const double y : {0.0, 25.0, 50.0, 100.0})
    EXPECT_TRUE((wider.sigma_at_mm({0, y, 0}).array() >= about_a_point.sigma_at_mm({0, y, 0}).array()).all()) << y;
  const Uncertainty of_translation = uncertainty_of_independent_axes({0.1, 0.1, 0.1}, Vector3d::Zero());
  EXPECT_EQ(widened_to_spread(of_translation, 0.0, 0.1).sigma_rotation_rad(), Vector3d::Zero());
}

// A cylinder along the patient (room y) may turn about it and, longer than the views, move along it.
TEST(Uncertainty, OfALongCylinderIsAbsentOrLargeAlongIt) {
  SceneOptions options{.shapes = {make_shape(Shape::Kind::kCylinder, {0, 0, 0}, {40, 30, 300}, {.water = 1.0}),
                                  make_shape(Shape::Kind::kCylinder, {10, 5, 0}, {8, 8, 300}, {.bone = 0.5})},
                       .photons = 500.0};
  options.ct_mm = Vector3d(120, 120, 300);
  const auto uncertainty = uncertainty_at_truth(make_scene(options), /*translation_only=*/true);
  if (uncertainty) {
    EXPECT_GT(uncertainty->sigma_translation_mm().y(), 5.0 * uncertainty->sigma_translation_mm().x());
    EXPECT_GT(2.0 * uncertainty->sigma_translation_mm().y(), 1.0);
  }
}

TEST(Uncertainty, OfTranslationsTakesRotationsAsKnown) {
  const RegistrationScene scene = make_scene(small_scene(200.0));
  const auto all = uncertainty_at_truth(scene), translation = uncertainty_at_truth(scene, true);
  ASSERT_TRUE(all && translation);
  EXPECT_EQ(translation->sigma_rotation_rad(), Vector3d::Zero());
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(translation->sigma_translation_mm()[axis], 0.0);
    // Fewer unknowns: hardly ever more uncertain.
    EXPECT_LT(translation->sigma_translation_mm()[axis], 1.3 * all->sigma_translation_mm()[axis]);
  }
}

TEST(Uncertainty, IsLargerWithAVolumeOfInterestAndWithCoarserVoxels) {
  const RegistrationScene scene = make_scene(small_scene(200.0));
  Objective objective = gradient_correlation(scene);
  const auto with = [&](const UncertaintyOptions& options) {
    return estimated_uncertainty(objective, scene.actual(), options).value();
  };
  const Uncertainty fine = with({.voxel_mm = 1.0}), coarse = with({.voxel_mm = 10.0});
  const Uncertainty overlapped = with({.voxel_mm = 1.0, .has_volume_of_interest = true});
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_GT(coarse.sigma_translation_mm()[axis], fine.sigma_translation_mm()[axis]);
    EXPECT_GT(overlapped.sigma_translation_mm()[axis], 1.2 * fine.sigma_translation_mm()[axis]);
    EXPECT_GT(overlapped.sigma_rotation_rad()[axis], 1.2 * fine.sigma_rotation_rad()[axis]);
  }
}

TEST(Uncertainty, OneViewIsLessCertainAlongItsRays) {
  SceneOptions options = small_scene(500.0);
  options.gantry_angles_deg = {0.0};
  const auto one = uncertainty_at_truth(make_scene(options));
  ASSERT_TRUE(one);
  EXPECT_GT(one->sigma_translation_mm().z(), 3.0 * one->sigma_translation_mm().x());
  EXPECT_GT(one->sigma_translation_mm().z(), 3.0 * one->sigma_translation_mm().y());
}

}  // namespace
}  // namespace isoshift::uncertainty_test
