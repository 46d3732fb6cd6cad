// Chosen regions that do not hold the target's bone: flipped, turned, shifted, in air, too small.

#include "registration/target/region_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "tests/support/cube_study.h"
#include "workflow/register/target_of.h"

namespace isoshift::region_check_test {
namespace {

using Eigen::Vector3d;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kRegionRadiusMm = 30.0, kMarginMm = 5.0;
const Vector3d kSpine(0.0, 40.0, 0.0);  // posterior of the body's middle

using Place = std::function<bool(const Vector3d& patient_mm)>;

bool is_near_axis(const Vector3d& at, const Vector3d& axis_mm, double radius_mm) {
  return (at - axis_mm).head<2>().norm() <= radius_mm;
}

// A trunk of water with a spine of bone and lungs of air in front of it, all along z; the isocenter in the spine.
Study study_of_trunk() {
  return cube_study(61, 3.0, kSpine, [](const Vector3d& at) {
    if (is_near_axis(at, kSpine, 15.0)) return 600.0F;
    if (is_near_axis(at, {-35.0, -15.0, 0.0}, 25.0) || is_near_axis(at, {35.0, -15.0, 0.0}, 25.0)) return -850.0F;
    return is_near_axis(at, Vector3d::Zero(), 75.0) ? 0.0F : -1000.0F;
  });
}

ChosenVolume chosen(const Study& study, const Place& is_in, bool is_excluded = false) {
  const Volume<float>& ct = study.ct->hu;
  ChosenVolume volume{.words = "structure Spine",
                      .mask = {ct.size, ct.patient_from_voxel},
                      .is_drawn = true,
                      .is_excluded = is_excluded};
  for (int k = 0; k < ct.size.z(); ++k)
    for (int j = 0; j < ct.size.y(); ++j)
      for (int i = 0; i < ct.size.x(); ++i)
        volume.mask.at(i, j, k) = is_in(ct.patient_from_voxel * Vector3d(i, j, k)) ? 1 : 0;
  return volume;
}

// A target of 10 mm at the isocenter.
std::vector<std::string> doubts(const Study& study, const std::vector<ChosenVolume>& volumes) {
  Target target{.name = "PTV"};
  for (int axis = 0; axis < 3; ++axis)
    for (const double side_mm : {-10.0, 10.0}) target.extent_room_mm.emplace_back(side_mm * Vector3d::Unit(axis));
  return region_doubts(planned_patient(study), volumes, kMarginMm, target, {});
}

bool is_spine(const Vector3d& at) { return is_near_axis(at, kSpine, kRegionRadiusMm); }

TEST(RegionDoubts, ARegionThatHoldsTheTargetsBoneIsRight) {
  const Study study = study_of_trunk();
  for (const Place& is_in : {
           Place(is_spine), Place([](const Vector3d&) { return true; }),  // all of the CT
           Place([](const Vector3d& at) { return (at - kSpine).norm() <= 40.0; }),
           Place([](const Vector3d& at) { return is_spine(at - Vector3d(8.0, -8.0, 0.0)); }),
           Place([](const Vector3d& at) { return is_spine(at) && std::abs(at.z()) < 15.0; }),  // a vertebra
       })
    if (const auto found = doubts(study, {chosen(study, is_in)}); !found.empty()) {
      // All of the CT is more air than body.
      EXPECT_THAT(found, ElementsAre(HasSubstr("lies outside of the body"))) << found.front();
    }
  EXPECT_THAT(doubts(study, {}), IsEmpty());
}

// The spine's own contours, mirrored in y about the CT's middle: what they hold is soft tissue and lung.
TEST(RegionDoubts, FlippedAndTurnedContoursAreNamedWithTheirShareOfBone) {
  const Study study = study_of_trunk();
  const Place flipped = [](const Vector3d& at) { return is_spine({at.x(), -at.y(), at.z()}); };
  const Place turned = [](const Vector3d& at) { return is_spine({at.y(), at.x(), at.z()}); };
  for (const Place& is_in : {flipped, turned}) {
    const auto found = doubts(study, {chosen(study, is_in)});
    EXPECT_THAT(found,
                Contains(HasSubstr("structure Spine hardly holds bone (bone is 0.0 % of it, on 0 of 61 slices; ")));
    EXPECT_THAT(found,
                Contains(HasSubstr("the region that was chosen holds 0 % of the bone within 20 mm of the target, "
                                   "25 % are expected: structure Spine (bone is 0.0 % of it")));
  }
  EXPECT_THAT(doubts(study, {chosen(study, flipped)}).back(), HasSubstr("mm from the isocenter"));
}

TEST(RegionDoubts, ARegionFarFromTheTargetOrTooSmallIsADoubt) {
  const Study study = study_of_trunk();
  const Place far = [](const Vector3d& at) { return is_spine(at) && at.z() > 55.0; };
  const Place tiny = [](const Vector3d& at) { return (at - kSpine).norm() < 3.5; };
  EXPECT_THAT(doubts(study, {chosen(study, far)}), ElementsAre(HasSubstr("holds 0 % of the bone within 20 mm")));
  EXPECT_THAT(doubts(study, {chosen(study, tiny)}), ElementsAre(HasSubstr("25 % are expected")));
  EXPECT_THAT(doubts(study, {chosen(study, far), chosen(study, is_spine)}), IsEmpty()) << "together they hold it";
}

TEST(RegionDoubts, AirOutsideOfTheBodyIsNoRegionAndLungsAreInIt) {
  const Study study = study_of_trunk();
  const Place outside = [](const Vector3d& at) { return is_near_axis(at, {-80.0, -80.0, 0.0}, 20.0); };
  const Place lung = [](const Vector3d& at) { return is_near_axis(at, {35.0, -15.0, 0.0}, 20.0); };
  EXPECT_THAT(doubts(study, {chosen(study, outside)}), Contains(HasSubstr("structure Spine lies outside of the body")));
  EXPECT_TRUE(is_in_body(chosen(study, lung).mask, study.ct->hu));
  EXPECT_THAT(doubts(study, {chosen(study, outside, true)}), ElementsAre(HasSubstr("lies outside of the body")));
  EXPECT_THAT(doubts(study, {chosen(study, lung, true)}), IsEmpty()) << "what is excluded need not hold bone";
}

// A site says that a structure's bones carry a target in soft tissue: some of these must be in the region.
TEST(RegionDoubts, ANamedSurrogateMustBeHeld) {
  const Study study = study_of_trunk();
  const Target in_lung{.center_room_mm = study.planned_room_from_patient * Vector3d(35.0, -15.0, 0.0)};
  const Volume<std::uint8_t> spine = chosen(study, is_spine).mask;
  EXPECT_THAT(region_doubts(planned_patient(study), std::vector{chosen(study, is_spine)}, kMarginMm, in_lung, spine),
              IsEmpty());
  const Place elsewhere = [](const Vector3d& at) { return is_near_axis(at, {0.0, -50.0, 0.0}, 15.0); };
  EXPECT_THAT(region_doubts(planned_patient(study), std::vector{chosen(study, elsewhere)}, kMarginMm, in_lung, spine),
              Contains(HasSubstr("holds 0 % of the bones that carry the target (the site file)")));
}

}  // namespace
}  // namespace isoshift::region_check_test
