#include "registration/presets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "geometry/patient_setup.h"
#include "phantom/study_writer.h"
#include "setup/couch_shift.h"
#include "tests/drr/test_views.h"
#include "tests/support/pose_near.h"

namespace isoshift::register_views_test {
namespace {

struct Scene {
  std::vector<XrayImage> xrays;
  Eigen::Isometry3d planned;
  Eigen::Isometry3d truth;
  Volume<float> ct;
  std::unique_ptr<RendererPyramid> renderers;
};

// Quicker by what looks for mirrored images.
RegistrationOptions without_alternatives() {
  RegistrationOptions options = preset("setup");
  options.check_alternatives = false;
  return options;
}

// X-rays by ray-shape intersections on one side, the program's own geometry on the other. Without scatter, which turns
// what matches best by some tenths of a degree where the patient is thick.
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
    Imager imager{.gantry_angle_deg = gantry_deg, .pixels = 256, .pixel_mm = 1.6, .scatter_share = 0.0};
    XrayImage xray;
    xray.view = centered_view(gantry_deg, imager.pixels, imager.pixel_mm);
    xray.values = simulate_xray(shapes, placement, imager, 20000.0, 1);
    scene.xrays.push_back(xray);
  }
  scene.planned =
      planned_room_from_patient(position, {.support_rad = rad_from_deg(couch_deg)}, Eigen::Vector3d::Zero());
  scene.truth.linear() = placement.rotation();
  scene.truth.translation() = placement.translation_mm;
  scene.ct = phantom_ct_of(shapes);
  scene.renderers = std::make_unique<RendererPyramid>(RendererKind::kCpu, scene.ct, AttenuationModel{}, kBothBeams);
  return scene;
}

TEST(RegisterViews, RecoversKnownOffsetFromTwoOrthogonalViewsInEveryPatientPosition) {
  for (const PatientPosition position : kPatientPositions) {
    const double couch_deg = position == PatientPosition::kHfs ? 0.0 : 20.0;
    Scene scene = make_scene(position, couch_deg, {0.0, 90.0});
    const auto result = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, without_alternatives());
    // Pixels of 1.1 mm at the isocenter and slices of 2 mm: about a fourth of a pixel, and its angle at 100 mm.
    EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient), PoseNear(scene.truth, 0.3, 0.2))
        << to_string(position);
    // The check that was left out is all that is missing.
    EXPECT_THAT(result.reasons(), testing::ElementsAre(testing::HasSubstr("leaves out the check")))
        << to_string(position);
  }
}

TEST(RegisterViews, AcceptsWhatItFindsAndSaysHowSureItIs) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  const auto result = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, preset("setup"));
  EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient), PoseNear(scene.truth, 0.3, 0.2));
  EXPECT_EQ(result.verdict(), Verdict::kAccepted) << testing::PrintToString(result.reasons());
  ASSERT_TRUE(result.uncertainty);
  EXPECT_GT(result.uncertainty->sigma_translation_mm().minCoeff(), 0.0);
  EXPECT_GT(result.uncertainty->sigma_rotation_rad().minCoeff(), 0.0);
  EXPECT_EQ(result.alternatives.size(), 5U);  // two views mirrored, turned, and exchanged
  ASSERT_EQ(result.views.size(), 2U);
  for (const ViewMatch& view : result.views) {
    EXPECT_GT(view.similarity_final, view.similarity_start);
    EXPECT_GT(view.consistency.with_signal(), 0);
    EXPECT_EQ(view.consistency.disagreeing(), 0);
  }
  EXPECT_TRUE(std::ranges::any_of(result.stages, [](const StageReport& s) { return s.spread_mm.has_value(); }));
  EXPECT_EQ(result.stages.size(), preset("setup").stages.size());
  EXPECT_GT(result.evaluations(), 100);
}

TEST(RegisterViews, OnlyTheRegionOfInterestIsCompared) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  // A metal bar across the first view, which the CT lacks, right of everything of interest.
  Image<float>& values = scene.xrays[0].values;
  for (int row = 0; row < values.rows; ++row)
    for (int column = 178; column < 200; ++column) values.at(column, row) *= 0.05F;
  const Volume<float>& ct = scene.ct;
  Volume<std::uint8_t> left(ct.size, ct.patient_from_voxel);
  for (int k = 0; k < ct.size.z(); ++k)
    for (int j = 0; j < ct.size.y(); ++j)
      for (int i = 0; i < ct.size.x(); ++i)
        left.at(i, j, k) = (ct.patient_from_voxel * Eigen::Vector3d(i, j, k)).x() < 30.0 ? 1 : 0;
  const auto region =
      std::make_shared<const ProjectedRegion>(RegionOfInterest{.volume = left, .excluded = {}, .cut_ends = {}});
  RegistrationOptions options = without_alternatives();
  options.region = region;
  const auto result = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, options);
  EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient), PoseNear(scene.truth, 0.5, 0.4));
}

TEST(RegisterViews, RecoversFromObliqueAndFromThreeViews) {
  for (const auto& gantry_angles : {std::vector<double>{315, 45}, std::vector<double>{0, 120, 240}}) {
    Scene scene = make_scene(PatientPosition::kHfs, 350.0, gantry_angles);
    const auto result = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, without_alternatives());
    EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient),
                PoseNear(scene.truth, 0.3, 0.2));
  }
}

// Oblique views: from the front this head and its mirror image are hard to tell apart.
TEST(RegisterViews, APatientExactlyOnPlanIsAccepted) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {30.0, 120.0}, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
  const auto result = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, preset("setup"));
  EXPECT_THAT(setup_error_from_poses(scene.planned, result.actual_room_from_patient), PoseNear(scene.truth, 0.3, 0.2));
  EXPECT_EQ(result.verdict(), Verdict::kAccepted) << testing::PrintToString(result.reasons());
}

TEST(RegisterViews, ABlankXrayIsAnError) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  std::ranges::fill(scene.xrays[1].values.pixels, 0.0F);
  scene.xrays[1].label = "DARK";
  try {
    register_views(*scene.renderers, prepared(scene.xrays), scene.planned, preset("setup"));
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("DARK: the X-ray is blank"));
  }
}

TEST(RegisterViews, SameSeedSamePose) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  const auto first = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, without_alternatives());
  const auto second = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, without_alternatives());
  EXPECT_EQ(first.actual_room_from_patient.matrix(), second.actual_room_from_patient.matrix());
  RegistrationOptions other_seed = without_alternatives();
  other_seed.seed = 2;
  const auto third = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, other_seed);
  EXPECT_NE(first.actual_room_from_patient.matrix(), third.actual_room_from_patient.matrix());  // the seed is used
  EXPECT_THAT(third.actual_room_from_patient, PoseNear(first.actual_room_from_patient, 0.1, 0.05));
}

TEST(RegisterViews, TranslationOnlyLeavesTheRotationAlone) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  RegistrationOptions options = without_alternatives();
  options.dof = Dof::kTranslation;
  const auto result = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, options);
  const auto error = setup_error_from_poses(scene.planned, result.actual_room_from_patient);
  EXPECT_TRUE(error.linear().isIdentity(1e-12));
  EXPECT_THAT(Eigen::Vector3d(error.translation()), VectorNear(Eigen::Vector3d(scene.truth.translation()), 2.0));
}

TEST(RegisterViews, ASetPoseIsJudgedAsItIsAndNeedsAReview) {
  Scene scene = make_scene(PatientPosition::kHfs, 0.0, {0.0, 90.0});
  RegistrationOptions options = preset("setup");
  options.is_searched = false;
  const auto right = register_views(*scene.renderers, prepared(scene.xrays), scene.truth * scene.planned, options);
  EXPECT_THAT(right.actual_room_from_patient, PoseNear(scene.truth * scene.planned, 1e-9, 1e-9));
  EXPECT_EQ(right.verdict(), Verdict::kReview);
  EXPECT_THAT(right.reasons(), testing::ElementsAre("the pose was set, not searched"));
  EXPECT_TRUE(right.stages.empty());
  EXPECT_TRUE(right.uncertainty);
  // The planned pose lies 10 mm off, and what is judged shows it.
  const auto wrong = register_views(*scene.renderers, prepared(scene.xrays), scene.planned, options);
  EXPECT_NE(wrong.verdict(), Verdict::kAccepted);
  EXPECT_GT(wrong.reasons().size(), 1U);
  EXPECT_LT(wrong.views[0].similarity_final, right.views[0].similarity_final - 0.1);
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
  const RenderResult drrs =
      scene.renderers->finest().render(std::span(&scene.xrays[0].view, 1), poses, PixelSet::all());
  const auto copy = [&](std::size_t pose) {
    const auto pixels = drrs.line_integrals(pose, 0);
    return std::vector<float>(pixels.begin(), pixels.end());
  };
  EXPECT_LT(relative_error(copy(2), copy(0)), 1e-4);
  EXPECT_GT(relative_error(copy(1), copy(0)), 0.05);
}

}  // namespace
}  // namespace isoshift::register_views_test
