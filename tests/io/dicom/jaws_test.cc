#include "io/dicom/jaws.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/dicom/rt_image.h"
#include "io/dicom/rt_plan.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"

namespace isoshift::jaws_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Four pairs of leaves, 10 mm wide.
const std::vector<double> kBoundariesMm = {-20, -10, 0, 10, 20};
const std::vector<double> kLeavesMm = {-30, -30, -15, -30, 30, 30, 30, 5};  // lower ends, then those opposite

DicomItem add_device(DicomItem& owner, const DcmTagKey& sequence, const std::string& type,
                     const std::vector<double>& positions_mm) {
  DicomItem device = owner.append_item(sequence);
  device.put(DCM_RTBeamLimitingDeviceType, type);
  if (!positions_mm.empty()) device.put(DCM_LeafJawPositions, positions_mm);
  return device;
}

class JawsTest : public testing::Test {
 protected:
  // The openings that the first X-ray's exposure says.
  JawOpenings of_exposure(const std::function<void(DicomItem exposure)>& say) {
    edit(study_.image(0), [&](DicomItem d) {
      d.erase(DCM_ExposureSequence);
      DicomItem exposure = d.append_item(DCM_ExposureSequence);
      say(exposure);
    });
    notes_ = {};
    return read_rt_images(study_.image(0), notes_).front().jaws;
  }

  JawOpenings of_leaves(const std::vector<double>& positions_mm, const std::vector<double>& boundaries_mm,
                        const char* pairs = "4") {
    return of_exposure([&](DicomItem exposure) {
      add_device(exposure, DCM_BeamLimitingDeviceSequence, "ASYMX", {-25, 25});
      DicomItem leaves = add_device(exposure, DCM_BeamLimitingDeviceSequence, "MLCX", positions_mm);
      leaves.put(DCM_NumberOfLeafJawPairs, pairs);
      if (!boundaries_mm.empty()) leaves.put(DCM_LeafPositionBoundaries, boundaries_mm);
    });
  }

  std::string problem() const { return notes_.warnings.size() == 1 ? notes_.warnings.front() : "not one warning"; }

  SmallStudy study_;
  Notes notes_;
};

TEST_F(JawsTest, AnImageDeclaresTheJawsOfItsExposure) {
  const JawOpenings jaws = of_exposure([](DicomItem exposure) {
    add_device(exposure, DCM_BeamLimitingDeviceSequence, "ASYMX", {-50, 60});
    add_device(exposure, DCM_BeamLimitingDeviceSequence, "Y", {-40, 40});
  });
  EXPECT_EQ(described(jaws), "X -50 to 60 mm, Y -40 to 40 mm");
  EXPECT_THAT(outline_of(jaws), ElementsAre(Eigen::Vector2d(-50, -40), Eigen::Vector2d(60, -40),
                                            Eigen::Vector2d(60, 40), Eigen::Vector2d(-50, 40)));
  EXPECT_THAT(notes_.warnings, IsEmpty());
}

TEST_F(JawsTest, AnImageWithoutDevicesDeclaresNothing) {
  const JawOpenings jaws = of_exposure([](DicomItem) {});
  EXPECT_EQ(described(jaws), "not declared");
  EXPECT_THAT(outline_of(jaws), IsEmpty());
}

TEST_F(JawsTest, LeavesAndJawsTogetherMakeTheOutline) {
  const JawOpenings openings = of_leaves(kLeavesMm, kBoundariesMm);
  EXPECT_THAT(notes_.warnings, IsEmpty());
  EXPECT_EQ(described(openings), "X -25 to 25 mm, 4 pairs of leaves along X, open by up to 60 mm");
  // The jaws stand before the leaves at both sides; one leaf reaches in from below, one from above.
  EXPECT_THAT(
      outline_of(openings),
      ElementsAre(Eigen::Vector2d(-25, -20), Eigen::Vector2d(-25, 0), Eigen::Vector2d(-15, 0), Eigen::Vector2d(-15, 10),
                  Eigen::Vector2d(-25, 10), Eigen::Vector2d(-25, 20), Eigen::Vector2d(5, 20), Eigen::Vector2d(5, 10),
                  Eigen::Vector2d(25, 10), Eigen::Vector2d(25, -20)));
}

TEST_F(JawsTest, LeavesAlongYAreTurned) {
  const JawOpenings openings = of_exposure([](DicomItem exposure) {
    DicomItem leaves = add_device(exposure, DCM_BeamLimitingDeviceSequence, "MLCY", {-10, -20, 10, 20});
    leaves.put(DCM_LeafPositionBoundaries, std::vector<double>{-5, 0, 5});
  });
  EXPECT_THAT(
      outline_of(openings),
      ElementsAre(Eigen::Vector2d(-5, -10), Eigen::Vector2d(0, -10), Eigen::Vector2d(0, -20), Eigen::Vector2d(5, -20),
                  Eigen::Vector2d(5, 20), Eigen::Vector2d(0, 20), Eigen::Vector2d(0, 10), Eigen::Vector2d(-5, 10)));
}

TEST_F(JawsTest, ClosedLeavesAtTheEndsAreNotOpen) {
  const JawOpenings openings = of_leaves({3, -20, -20, 3, 3, 20, 20, 3}, kBoundariesMm);
  EXPECT_THAT(outline_of(openings), ElementsAre(Eigen::Vector2d(-20, -10), Eigen::Vector2d(-20, 10),
                                                Eigen::Vector2d(20, 10), Eigen::Vector2d(20, -10)));
}

TEST_F(JawsTest, ClosedJawsAreNamedAndDrawNoField) {
  const JawOpenings jaws = of_exposure([](DicomItem exposure) {
    add_device(exposure, DCM_BeamLimitingDeviceSequence, "ASYMX", {5, 5});
    add_device(exposure, DCM_BeamLimitingDeviceSequence, "Y", {-40, 40});
  });
  EXPECT_THAT(outline_of(jaws), IsEmpty());
  EXPECT_THAT(problem(), HasSubstr("the jaws along X are closed (5 to 5 mm), so no field is drawn"));
  EXPECT_THAT(problem(), HasSubstr(study_.image(0).string()));
}

TEST_F(JawsTest, LeavesWithoutBoundariesAreLeftOutAndNamed) {
  const JawOpenings openings = of_leaves(kLeavesMm, {});
  EXPECT_EQ(described(openings), "X -25 to 25 mm");
  EXPECT_THAT(problem(), HasSubstr("MLCX is left out: LeafPositionBoundaries (300A,00BE) is missing"));
  EXPECT_THAT(problem(), HasSubstr(study_.image(0).string()));
}

TEST_F(JawsTest, WrongCountsAreNamed) {
  of_leaves({-30, -30, 30, 30}, kBoundariesMm);
  EXPECT_THAT(problem(), HasSubstr("LeafJawPositions (300A,011C) has 4 values, expected 8"));
  of_leaves(kLeavesMm, {-20, 0, 20});
  EXPECT_THAT(problem(), HasSubstr("LeafPositionBoundaries (300A,00BE) has 3 values, expected 5"));
  of_leaves(kLeavesMm, {-20, 0, -10, 10, 20});
  EXPECT_THAT(problem(), HasSubstr("LeafPositionBoundaries (300A,00BE) does not rise"));
  const JawOpenings openings = of_exposure(
      [](DicomItem exposure) { add_device(exposure, DCM_BeamLimitingDeviceSequence, "ASYMX", {-25, 25, 30}); });
  EXPECT_TRUE(openings.is_empty());
  EXPECT_THAT(problem(), HasSubstr("ASYMX is left out: LeafJawPositions (300A,011C) has 3 values, expected 2"));
}

TEST_F(JawsTest, SwappedEndsAreNamed) {
  of_exposure([](DicomItem exposure) { add_device(exposure, DCM_BeamLimitingDeviceSequence, "Y", {40, -40}); });
  EXPECT_THAT(problem(), HasSubstr("has its ends swapped: pair 1 goes from 40 to -40 mm"));
  of_leaves({-30, -30, 30, -30, 30, 30, -15, 5}, kBoundariesMm);
  EXPECT_THAT(problem(), HasSubstr("has its ends swapped: pair 3 goes from 30 to -15 mm"));
}

TEST_F(JawsTest, UnknownDevicesAndMissingPositionsAreNamed) {
  of_exposure([](DicomItem exposure) { add_device(exposure, DCM_BeamLimitingDeviceSequence, "IRIS", {-5, 5}); });
  EXPECT_THAT(problem(), HasSubstr("is \"IRIS\", expected X, Y, ASYMX, ASYMY, MLCX or MLCY"));
  of_exposure([](DicomItem exposure) { add_device(exposure, DCM_BeamLimitingDeviceSequence, "X", {}); });
  EXPECT_THAT(problem(), HasSubstr("X is left out: LeafJawPositions (300A,011C) is missing"));
}

TEST_F(JawsTest, APlanDeclaresThoseOfItsFirstControlPoint) {
  edit(study_.plan(), [](DicomItem plan) {
    DicomItem beam = plan.items(DCM_BeamSequence).front();
    DicomItem device = add_device(beam, DCM_BeamLimitingDeviceSequence, "MLCX", {});
    device.put(DCM_NumberOfLeafJawPairs, "4");
    device.put(DCM_LeafPositionBoundaries, kBoundariesMm);
    DicomItem point = beam.items(DCM_ControlPointSequence).front();
    add_device(point, DCM_BeamLimitingDevicePositionSequence, "ASYMY", {-15, 15});
    add_device(point, DCM_BeamLimitingDevicePositionSequence, "MLCX", kLeavesMm);
  });
  const RtPlan plan = read_rt_plan(study_.plan());
  EXPECT_EQ(described(plan.beams[0].jaws), "Y -15 to 15 mm, 4 pairs of leaves along X, open by up to 60 mm");
  EXPECT_THAT(plan.beams[0].jaws.problems, IsEmpty());
  EXPECT_EQ(described(plan.beams[1].jaws), "not declared");
}

TEST_F(JawsTest, APlanWithoutBoundariesOfItsLeavesSaysSo) {
  edit(study_.plan(), [](DicomItem plan) {
    DicomItem point = plan.items(DCM_BeamSequence).front().items(DCM_ControlPointSequence).front();
    add_device(point, DCM_BeamLimitingDevicePositionSequence, "MLCX", kLeavesMm);
  });
  const RtPlan plan = read_rt_plan(study_.plan());
  EXPECT_TRUE(plan.beams[0].jaws.is_empty());
  EXPECT_THAT(plan.beams[0].jaws.problems, ElementsAre(HasSubstr("LeafPositionBoundaries (300A,00BE) is missing")));
}

// The gantry's and the collimator's angle turn what is declared; the kV imager's beam does not pass the jaws.
TEST_F(JawsTest, TheOutlineIsProjectedOntoTheImage) {
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_BeamLimitingDeviceAngle, "90"); });
  const JawOpenings jaws = of_exposure([](DicomItem exposure) {
    add_device(exposure, DCM_BeamLimitingDeviceSequence, "X", {-50, 60});
    add_device(exposure, DCM_BeamLimitingDeviceSequence, "Y", {-40, 40});
  });
  const RtImage image = read_rt_images(study_.image(0), notes_).front();
  const XrayView view = xray_view(image, Beam::kMegavoltage, notes_);
  const auto aperture = declared_aperture(image, jaws, view);
  ASSERT_TRUE(aperture);
  EXPECT_TRUE(aperture->is_of_exposure);
  ASSERT_EQ(aperture->corners_px.size(), 4U);
  // Gantry 0: the collimator's x, turned by 90 degrees, is the room's y.
  EXPECT_LT((aperture->corners_px[0] - view.project(Eigen::Vector3d(40, -50, 0)).value()).norm(), 1e-6);
  EXPECT_LT((aperture->corners_px[2] - view.project(Eigen::Vector3d(-40, 60, 0)).value()).norm(), 1e-6);
  EXPECT_FALSE(declared_aperture(image, jaws, xray_view(image, Beam::kKilovoltage, notes_))->is_of_exposure);
}

}  // namespace
}  // namespace isoshift::jaws_test
