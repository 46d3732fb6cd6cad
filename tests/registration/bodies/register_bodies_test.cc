// The target of a patient who bent is right, whatever the rest did, and what does not match is not accepted.

#include "registration/bodies/register_bodies.h"

#include <gtest/gtest.h>

#include "registration/presets.h"
#include "tests/drr/test_views.h"
#include "tests/support/bent_scene.h"
#include "tests/support/findings.h"

namespace isoshift::register_bodies_test {
namespace {

using Eigen::Vector3d;

std::vector<MovedGroup> bent_motions() {
  return {{.translation_mm = {1.0, -2.0, 1.5}, .rotation_deg = {-3.0, 1.0, 0.5}},
          {.translation_mm = {2.0, -1.0, 0.5}, .rotation_deg = {-0.5, 0.5, 1.0}},
          {.translation_mm = {2.5, -1.0, 0.0}, .rotation_deg = {2.0, -1.0, 1.5}}};
}

// The scene's bodies as those of a patient who is bone all over; the target lies in the middle one.
BentPatient patient_of(const BentScene& scene, float to_bone_mm = 0.0F) {
  PatientBodies parts;
  parts.bodies = scene.bodies;
  parts.carried = scene.bodies.shares;
  parts.to_bone_mm = Volume<float>(scene.ct.size, scene.ct.patient_from_voxel);
  std::ranges::fill(parts.to_bone_mm.voxels, to_bone_mm);
  Target target{.name = "PTV"};
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-8.0, 8.0}) target.extent_room_mm.push_back(side * Vector3d::Unit(axis));
  // A structure in the body above.
  Target structure = target;
  structure.name = "cord";
  structure.center_room_mm = {0, 36, 0};
  for (Vector3d& point : structure.extent_room_mm) point += structure.center_room_mm;
  return {scene.ct, {}, std::array{Beam::kKilovoltage}, std::move(parts), std::move(target), {std::move(structure)}};
}

RegistrationResult registered(const BentScene& scene, const std::vector<FixedImage>& images,
                              const RegistrationOptions& options) {
  const RendererPyramid renderers(RendererKind::kCpu, scene.ct, {}, std::array{Beam::kKilovoltage});
  RegistrationResult result = register_views(renderers, images, scene.planned, options);
  register_bodies(patient_of(scene), images, scene.planned, options, result);
  return result;
}

TEST(RegisterBodies, TheTargetIsRightAndTheRestIsSaid) {
  const BentScene scene = bent_column(bent_motions());
  const RegistrationResult result = registered(scene, scene.images, preset("setup"));
  const Eigen::Isometry3d found = result.actual_room_from_patient * scene.planned.inverse();
  for (int n = 0; n < 8; ++n) {
    const Vector3d place = 7.5 * Vector3d(2 * (n & 1) - 1, 2 * ((n >> 1) & 1) - 1, 2 * (n >> 2) - 1);
    EXPECT_LT((found * place - scene.truth[1] * place).norm(), 0.8);  // with voxels of 2 mm
  }
  ASSERT_EQ(result.bodies.size(), 3U);
  EXPECT_GT(result.bodies[1].carries_target, 0.9);
  EXPECT_LT(result.bodies[1].displacement_mm.norm(), 0.2) << "the target's own body does not move against it";
  for (const std::size_t other : {std::size_t{0}, std::size_t{2}}) {
    const Vector3d center = result.bodies[other].center_room_mm;
    const Vector3d truth = scene.truth[1].inverse() * scene.truth[other] * center - center;
    // Voxels of 2 mm, which the sigmas do not know of.
    EXPECT_LT((result.bodies[other].displacement_mm - truth).norm(), 1.5) << "body " << other;
    EXPECT_TRUE(result.bodies[other].is_determined());
  }
  ASSERT_EQ(result.structures.size(), 1U);
  EXPECT_EQ(result.structures[0].name, "cord");
  const Vector3d of_structure = scene.truth[1].inverse() * scene.truth[2] * Vector3d(0, 36, 0) - Vector3d(0, 36, 0);
  EXPECT_LT((result.structures[0].displacement_mm - of_structure).norm(), 1.5);
  EXPECT_GT(result.structures[0].most_mm, of_structure.norm() - 1.5);
  EXPECT_GT(result.target_image_share, 0.5);
  EXPECT_GT(result.target_match.of_most_within_40_mm, 0.9);
  EXPECT_GT(result.target_match.of_all, 0.8);
  for (const ViewMatch& view : result.views) EXPECT_GT(view.similarity_final, 0.8);
}

// Freedom to bend must not let in what is not this patient.
TEST(RegisterBodies, AnotherPatientIsNotAccepted) {
  const BentScene scene = bent_column(bent_motions());
  // Where the CT shows vertebrae 1 to 3, the X-rays show 4 to 6 of another column.
  const BentScene other = bent_column(std::vector<MovedGroup>(6, {.translation_mm = {0.0, -54.0, 0.0}}));
  const RegistrationResult result = registered(scene, other.images, preset("setup"));
  EXPECT_NE(result.verdict(), Verdict::kAccepted);
}

TEST(RegisterBodies, WithoutBoneNearTheTargetTheWholeAnswersForReview) {
  const BentScene scene = bent_column(bent_motions());
  const RendererPyramid renderers(RendererKind::kCpu, scene.ct, {}, std::array{Beam::kKilovoltage});
  const RegistrationOptions options = preset("fast");
  const RegistrationResult whole = register_views(renderers, scene.images, scene.planned, options);
  RegistrationResult result = whole;
  register_bodies(patient_of(scene, 25.0F), scene.images, scene.planned, options, result);
  EXPECT_EQ(result.actual_room_from_patient.matrix(), whole.actual_room_from_patient.matrix());
  EXPECT_TRUE(result.bodies.empty());
  EXPECT_NE(result.verdict(), Verdict::kAccepted);
  ASSERT_FALSE(result.findings.empty());
  EXPECT_EQ(result.findings.back().check, Check::kNoBone);
}

// A whole with a view whose parts near the isocenter have a signal.
struct SeenWhole {
  std::vector<FixedImage> images = std::vector<FixedImage>(1, {.view = centered_view(0.0, 200, 1.5)});
  RegistrationResult result;

  SeenWhole() {
    result.findings.clear();
    result.views.resize(1);
    for (const double x : {80.0, 100.0, 120.0})
      result.views[0].consistency.parts.push_back({.center_px = {x, 100.0}, .has_signal = true});
  }
  bool may_have_bent(RegistrationOptions options, const Vector3d& target_mm = Vector3d::Zero()) const {
    options.target_patient_mm = target_mm;  // the pose is the identity
    return isoshift::may_have_bent(options, images, result);
  }
};

// Too far for parts of the images to be found again where they went.
TEST(RegisterBodies, ATargetThatMovedFarIsNotWhereTheWholePutsIt) {
  const RegistrationOptions options = preset("setup");
  const auto may_lie_elsewhere = [&](const BentScene& scene) {
    const RendererPyramid renderers(RendererKind::kCpu, scene.ct, {}, std::array{Beam::kKilovoltage});
    RegistrationResult whole;
    whole.findings.clear();
    whole.actual_room_from_patient = scene.truth[0] * scene.planned;
    return may_target_lie_elsewhere(renderers, scene.images, options, whole);
  };
  const MovedGroup still{.translation_mm = {1.0, -2.0, 1.5}},
      far{.translation_mm = {1.0, 10.0, 16.0}, .rotation_deg = {20.0, 0.0, 0.0}};
  EXPECT_FALSE(may_lie_elsewhere(bent_column({still, still, still})));
  EXPECT_TRUE(may_lie_elsewhere(bent_column({still, far, still})));
}

TEST(RegisterBodies, OnlyPatientsWhoNeedAReviewMayHaveBent) {
  SeenWhole whole;
  RegistrationOptions options = preset("setup");
  EXPECT_FALSE(whole.may_have_bent(options)) << "accepted";
  whole.result.findings = findings_for(Verdict::kRejected);
  EXPECT_FALSE(whole.may_have_bent(options));
  whole.result.findings = findings_for(Verdict::kReview);
  EXPECT_TRUE(whole.may_have_bent(options));
  EXPECT_FALSE(whole.may_have_bent(preset("fast"))) << "it leaves out the checks";
  options.dof = Dof::kTranslation;
  EXPECT_FALSE(whole.may_have_bent(options));
  options.dof = Dof::kRigid;
  whole.result.unobservable_room = {Vector3d::UnitX()};
  EXPECT_FALSE(whole.may_have_bent(options));
}

// A whole that is accepted for what it shows elsewhere says nothing of a target far off.
TEST(RegisterBodies, AWholeThatDoesNotShowTheTargetMayHaveBent) {
  const RegistrationOptions options = preset("setup");
  SeenWhole whole;
  EXPECT_FALSE(whole.may_have_bent(options, {20, 0, 0}));
  EXPECT_TRUE(whole.may_have_bent(options, {0, 90, 0})) << "far from all parts";
  whole.result.views[0].consistency.parts[1].disagrees = true;
  EXPECT_TRUE(whole.may_have_bent(options)) << "a part next to the target matches elsewhere";
  // Farther off one in five may.
  EXPECT_TRUE(whole.may_have_bent(options, {0, 0, 40})) << "one of three";
  for (const double x : {90.0, 110.0})
    whole.result.views[0].consistency.parts.push_back({.center_px = {x, 100.0}, .has_signal = true});
  EXPECT_FALSE(whole.may_have_bent(options, {0, 40, 0})) << "one of five";
  EXPECT_TRUE(whole.may_have_bent(options)) << "of many, too";
  whole = SeenWhole();
  for (ViewPart& part : whole.result.views[0].consistency.parts) part.has_signal = false;
  EXPECT_TRUE(whole.may_have_bent(options)) << "noise";
}

}  // namespace
}  // namespace isoshift::register_bodies_test
