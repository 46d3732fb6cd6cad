#include "registration/presets.h"

#include <gtest/gtest.h>

#include "geometry/couch_shift.h"
#include "geometry/error.h"
#include "geometry/patient_setup.h"
#include "phantom/study_writer.h"
#include "tests/drr/test_views.h"
#include "tests/support/pose_near.h"

namespace isoshift {
namespace {

struct Scene {
  std::vector<XrayImage> xrays;
  Eigen::Isometry3d planned;
  Eigen::Isometry3d truth;
  std::unique_ptr<RendererPyramid> renderers;
};

// X-rays by ray-shape intersections on one side, the program's own geometry on the other.
Scene make_scene(PatientPosition position, double couch_deg, const std::vector<double>& gantry_angles_deg,
                 const Eigen::Vector3d& translation_mm = {-6.2, 4.7, 5.9},
                 const Eigen::Vector3d& rotation_deg = {-1.6, 2.2, -1.3}) {
  Placement placement;
  placement.patient_position = to_string(position);
  placement.couch_angle_deg = couch_deg;
  placement.translation_mm = translation_mm;
  placement.rotation_deg = rotation_deg;
  const std::vector<Shape> shapes = head_phantom(Eigen::Vector3d::Zero(), 5);
  Scene scene;
  for (const double gantry_deg : gantry_angles_deg) {
    Imager imager{.gantry_angle_deg = gantry_deg, .pixels = 256, .pixel_mm = 1.6};
    XrayImage xray;
    xray.view = centered_view(gantry_deg, imager.pixels, imager.pixel_mm);
    xray.values = simulate_xray(shapes, placement, imager, 20000.0, 1);
    scene.xrays.push_back(xray);
  }
  scene.planned =
      planned_room_from_patient(position, {.support_rad = rad_from_deg(couch_deg)}, Eigen::Vector3d::Zero());
  scene.truth.linear() = placement.rotation();
  scene.truth.translation() = placement.translation_mm;
  scene.renderers = std::make_unique<RendererPyramid>(RendererKind::kCpu, phantom_ct_of(shapes), AttenuationModel{}, kBothBeams);
  return scene;
}

TEST(RegisterViews, RecoversKnownOffsetFromTwoOrthogonalViewsInEveryPatientPosition) {
  for (const PatientPosition position : kPatientPositions) {
    const double couch_deg = position == PatientPosition::kHfs ? 0.0 : 20.0;
    Scene scene = make_scene(position, couch_deg, {0.0, 90.0});
    const auto result = register_views(*scene.renderers, scene.xrays, scene.planned, preset("setup"));
    // Pixels of 1.1 mm at the isocenter and slices of 2 mm: about a fourth of a pixel, and its angle at 100 mm.
    EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient), PoseNear(scene.truth, 0.3, 0.2))
        << to_string(position);
    EXPECT_EQ(result.verdict, Verdict::kAccepted) << to_string(position);
  }
}

TEST(RegisterViews, RecoversFromObliqueAndFromThreeViews) {
  for (const auto& gantry_angles : {std::vector<double>{315, 45}, std::vector<double>{0, 120, 240}}) {
    Scene scene = make_scene(PatientPosition::kHfs, 350.0, gantry_angles);
    const auto result = register_views(*scene.renderers, scene.xrays, scene.planned, preset("setup"));
    EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient),
                PoseNear(scene.truth, 0.3, 0.2));
  }
}

TEST(RegisterViews, APatientExactlyOnPlanIsAccepted) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0}, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  const auto result = register_views(*scene.renderers, scene.xrays, scene.planned, preset("setup"));
  EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient), PoseNear(scene.truth, 0.3, 0.2));
  EXPECT_EQ(result.verdict, Verdict::kAccepted) << testing::PrintToString(result.reasons);
}

TEST(RegisterViews, ABlankXrayIsAnError) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  std::ranges::fill(scene.xrays[1].values.pixels, 0.0F);
  scene.xrays[1].label = "DARK";
  try {
    register_views(*scene.renderers, scene.xrays, scene.planned, preset("setup"));
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("DARK: the X-ray is blank"));
  }
}

TEST(RegisterViews, SameSeedSamePose) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  const auto first = register_views(*scene.renderers, scene.xrays, scene.planned, preset("setup"));
  const auto second = register_views(*scene.renderers, scene.xrays, scene.planned, preset("setup"));
  EXPECT_EQ(first.actual_room_from_patient.matrix(), second.actual_room_from_patient.matrix());
  RegistrationOptions other_seed = preset("setup");
  other_seed.seed = 2;
  const auto third = register_views(*scene.renderers, scene.xrays, scene.planned, other_seed);
  EXPECT_NE(first.actual_room_from_patient.matrix(), third.actual_room_from_patient.matrix());  // the seed is used
  EXPECT_THAT(third.actual_room_from_patient, PoseNear(first.actual_room_from_patient, 0.1, 0.05));
}

TEST(RegisterViews, TranslationOnlyLeavesTheRotationAlone) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  RegistrationOptions options = preset("setup");
  options.dof = Dof::kTranslation;
  const auto result = register_views(*scene.renderers, scene.xrays, scene.planned, options);
  const auto error = setup_error_from_poses(scene.planned, result.actual_room_from_patient);
  EXPECT_TRUE(error.linear().isIdentity(1e-12));
  EXPECT_THAT(Eigen::Vector3d(error.translation()), VectorNear(Eigen::Vector3d(scene.truth.translation()), 2.0));
}

TEST(RegisterViews, AShiftThatUndoesTheErrorRestoresThePlannedView) {
  // Rendered check of the couch's algebra: move the found patient back and render again.
  Scene scene = make_scene(PatientPosition::kFfs, 30.0, {0.0, 90.0});
  const TableAngles table{.support_rad = rad_from_deg(30.0)};
  const Eigen::Isometry3d actual = scene.truth * scene.planned;
  const CouchShift shift = couch_shift_for(setup_error_from_poses(scene.planned, actual), table);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = rotation_from_zxy(shift.target) * rotation_from_zxy(table.zxy()).transpose();
  motion.translation() = motion.linear() * (rotation_z(table.yaw_rad()) * shift.translation_mm);
  const std::array poses = {scene.planned, actual, Eigen::Isometry3d(motion * actual)};
  const RenderResult drrs = scene.renderers->finest().render(std::span(&scene.xrays[0].view, 1), poses, PixelSet::all());
  const auto copy = [&](std::size_t pose) {
    const auto pixels = drrs.line_integrals(pose, 0);
    return std::vector<float>(pixels.begin(), pixels.end());
  };
  EXPECT_LT(relative_error(copy(2), copy(0)), 1e-4);
  EXPECT_GT(relative_error(copy(1), copy(0)), 0.05);
}

}  // namespace
}  // namespace isoshift
