// A target that X-rays do not show is told, unless the site says which bones carry it.

#include "workflow/register/target_of.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/phantom_ct.h"
#include "tests/support/small_study.h"

namespace isoshift::surrogate_test {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

// Water with a bone of 20 mm about the patient's (0, 0, -40); the isocenter at the origin.
Study study_with_bone() {
  Study study;
  CtSeries ct;
  Eigen::Affine3d lattice(Eigen::Translation3d(-80.0, -80.0, -80.0));
  lattice.scale(2.0);
  ct.hu = Volume<float>(Eigen::Vector3i(81, 81, 81), lattice);
  for (int k = 0; k < 81; ++k)
    for (int j = 0; j < 81; ++j)
      for (int i = 0; i < 81; ++i)
        if ((lattice * Vector3d(i, j, k) - Vector3d(0, 0, -40)).cwiseAbs().maxCoeff() <= 10.0)
          ct.hu.at(i, j, k) = 700.0F;
  ct.frame_of_reference_uid = "1.2.3";
  study.ct = std::make_shared<const CtSeries>(std::move(ct));
  study.planned_room_from_patient =
      planned_room_from_patient(PatientPosition::kHfs, study.table, study.isocenter_patient_mm);
  Structure pelvis{.number = 1, .name = "Pelvis", .interpreted_type = "ORGAN"};
  for (double z = -60.0; z <= -20.0; z += 4.0)
    pelvis.contours.push_back({.points_patient_mm = rectangle({0.0, 0.0, z}, 60.0, 60.0)});
  study.structures = RtStructures{.structures = {pelvis}};
  return study;
}

// At a place in the patient, with its surface that far toward the patient's feet.
Target target_at(const Study& study, const Vector3d& patient_mm, double radius_mm) {
  const Eigen::Isometry3d& room = study.planned_room_from_patient;
  return {.name = "PTV",
          .center_room_mm = room * patient_mm,
          .extent_room_mm = {room * Vector3d(patient_mm - radius_mm * Vector3d::UnitZ())}};
}

TEST(Surrogate, BoneNearTheCenterOrTheSurfaceShowsTheTarget) {
  const Study study = study_with_bone();
  BodyStore bodies;
  for (const Target& near :
       {target_at(study, {0, 0, -40}, 5.0), target_at(study, {0, 0, -15}, 2.0), target_at(study, {0, 0, 20}, 35.0)}) {
    const Surrogate surrogate = surrogate_of(study, near, "", bodies);
    EXPECT_EQ(surrogate.words, "bone within 20 mm");
    EXPECT_FALSE(surrogate.doubt);
    EXPECT_FALSE(surrogate.drawn);
  }
}

TEST(Surrogate, SoftTissueAloneIsADoubt) {
  const Study study = study_with_bone();
  BodyStore bodies;
  for (const Target& far : {target_at(study, {0, 0, 20}, 10.0), target_at(study, {60, 0, -40}, 10.0)}) {
    const Surrogate surrogate = surrogate_of(study, far, "", bodies);
    ASSERT_TRUE(surrogate.doubt);
    EXPECT_THAT(*surrogate.doubt, HasSubstr("no bone lies within 20 mm of the target"));
  }
}

// As planned with the isocenter at the origin.
Study study_of(const PhantomCt& phantom) {
  Study study;
  study.ct = std::make_shared<const CtSeries>(CtSeries{.hu = phantom.make()});
  study.planned_room_from_patient =
      planned_room_from_patient(PatientPosition::kHfs, study.table, study.isocenter_patient_mm);
  return study;
}

std::ptrdiff_t vertebrae_in(const BodyMap& map) {
  return std::ranges::count(map.bodies, Body::Kind::kVertebra, &Body::kind);
}

// Ribs breathe, and shoulder blades go with the arms: the answer of the whole patient is not theirs, also where a short
// CT shows three vertebrae.
TEST(Surrogate, RibsAloneAreADoubt) {
  for (const double cropped_mm : {0.0, 120.0}) {
    const Study study =
        study_of({.anatomy = "thorax", .seed = 5, .spacing_mm = {2, 2, 3}, .cropped_mm = {0.0, 0.0, cropped_mm}});
    BodyStore bodies;
    const BodyMap& map = *bodies.map(planned_patient(study).ct_hu);
    ASSERT_EQ(cropped_mm > 0.0, vertebrae_in(map) < 4);
    const Vector3d vertebra = std::ranges::find(map.bodies, Body::Kind::kVertebra, &Body::kind)->center_patient_mm;
    const auto aside = std::ranges::max(map.bodies, {}, [&](const Body& one) {
      return one.kind == Body::Kind::kCouch ? 0.0 : (one.center_patient_mm - vertebra).norm();
    });
    const Surrogate by_rib = surrogate_of(study, target_at(study, aside.center_patient_mm, 5.0), "", bodies);
    ASSERT_TRUE(by_rib.doubt) << cropped_mm;
    EXPECT_THAT(*by_rib.doubt, HasSubstr("hardly more than ribs, bones of the shoulders"));
    for (const double side_mm : {0.0, 25.0})
      EXPECT_FALSE(surrogate_of(study, target_at(study, vertebra + side_mm * Vector3d::UnitX(), 5.0), "", bodies).doubt)
          << cropped_mm;
  }
}

// Collar bones, shoulder blades and the heads of the arms touch ribs, in a short CT as in a long one.
TEST(Surrogate, ShouldersAreADoubt) {
  for (const double length_mm : {210.0, 90.0}) {
    const Study study = study_of({.anatomy = "thorax",
                                  .seed = 5,
                                  .spacing_mm = {2, 2, 3},
                                  .has_shoulders = true,
                                  .cropped_mm = {0.0, 0.0, 210.0 - length_mm},
                                  .shifted_mm = {0.0, 0.0, 0.5 * (210.0 - length_mm)}});
    BodyStore bodies;
    ASSERT_EQ(length_mm < 210.0, vertebrae_in(*bodies.map(planned_patient(study).ct_hu)) < 4);
    const Vector3d spine = PhantomCt::center() + Vector3d(65.0, 0.0, 0.0);  // of a thorax, aside of its tumor
    for (const double side : {-1.0, 1.0})
      for (const Vector3d& at :
           {Vector3d(30, -66, 81), Vector3d(72, -52, 88), Vector3d(88, 78, 48), Vector3d(128, 8, 80)}) {
        const Vector3d shoulder = spine + Vector3d(side * at.x(), at.y(), at.z());
        EXPECT_TRUE(surrogate_of(study, target_at(study, shoulder, 10.0), "", bodies).doubt)
            << length_mm << " at " << side << ": " << at.transpose();
      }
  }
}

// The neck of a head CT, in front of its vertebrae and behind them; not the skull, and not the jaw at their height.
TEST(Surrogate, AShortNeckIsADoubt) {
  const PhantomCt head{.anatomy = "head", .seed = 5};
  const Study study = study_of(head);
  BodyStore bodies;
  const std::ptrdiff_t count = vertebrae_in(*bodies.map(planned_patient(study).ct_hu));
  ASSERT_GT(count, 0);
  ASSERT_LT(count, 4);
  const Vector3d second = head.vertebrae()[1];
  for (const double back_mm : {-25.0, 0.0, 26.0, 45.0}) {
    const Surrogate surrogate =
        surrogate_of(study, target_at(study, second + back_mm * Vector3d::UnitY(), 10.0), "", bodies);
    ASSERT_TRUE(surrogate.doubt) << back_mm;
    EXPECT_THAT(*surrogate.doubt, HasSubstr("the target lies at the neck"));
  }
  for (const Vector3d& at : {Vector3d(0, -30, -45), Vector3d(0, 40, -25), Vector3d(0, 4, 85), Vector3d(0, -60, -70)})
    EXPECT_FALSE(surrogate_of(study, target_at(study, PhantomCt::center() + at, 10.0), "", bodies).doubt)
        << at.transpose();
}

// What is dense beside the ribs of a trunk, and no bone.
TEST(Surrogate, DenseSoftTissueIsNoBone) {
  Study study = study_of({.anatomy = "thorax", .seed = 5, .spacing_mm = {2, 2, 3}});
  BodyStore bodies;
  const BodyMap map = *bodies.map(planned_patient(study).ct_hu);
  CtSeries ct = *study.ct;
  const Vector3d front = map.bodies.front().center_patient_mm + Vector3d(-60.0, -70.0, 40.0);
  int near = 0;
  for (int k = 0; k < ct.hu.size.z(); ++k)
    for (int j = 0; j < ct.hu.size.y(); ++j)
      for (int i = 0; i < ct.hu.size.x(); ++i)
        if ((ct.hu.patient_from_voxel * Vector3d(i, j, k) - front).norm() <= 4.0) ct.hu.at(i, j, k) = 400.0F, ++near;
  ASSERT_GT(near, 10);
  study.ct = std::make_shared<const CtSeries>(std::move(ct));
  const Surrogate surrogate = surrogate_of(study, target_at(study, front, 5.0), "", bodies);
  ASSERT_TRUE(surrogate.doubt);
  EXPECT_THAT(*surrogate.doubt, HasSubstr("was not recognized as a bone"));
  EXPECT_EQ(surrogate.words, "dense places, not recognized as bone, within 20 mm");
}

TEST(Surrogate, IsTheStructureThatTheSiteNames) {
  Study study = study_with_bone();
  BodyStore bodies;
  const Target far = target_at(study, {0, 0, 60}, 5.0);
  const Surrogate surrogate = surrogate_of(study, far, "Pelvis", bodies);
  EXPECT_EQ(surrogate.words, "bones in Pelvis (the site file)");
  EXPECT_FALSE(surrogate.doubt);
  ASSERT_TRUE(surrogate.drawn);
  EXPECT_GT(std::ranges::count(surrogate.drawn->voxels, 1), 1000);
  EXPECT_THROW(surrogate_of(study, far, "Femur", bodies), Error);
  for (Contour& contour : study.structures->structures[0].contours)
    for (Vector3d& point : contour.points_patient_mm) point.z() += 80.0;
  EXPECT_THROW(surrogate_of(study, far, "Pelvis", bodies), Error) << "it holds no bone";
  study.structures.reset();
  EXPECT_THROW(surrogate_of(study, far, "Pelvis", bodies), Error);
}

}  // namespace
}  // namespace isoshift::surrogate_test
