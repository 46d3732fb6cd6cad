// Angles of X-rays against those of the beams that they name.

#include "io/study/planned_pose.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/small_study.h"

namespace isoshift::planned_pose_test {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class PlannedPoseTest : public testing::Test {
 protected:
  // Beams 1 and 2 have gantry 0 and 90, as KV_G000 and KV_G090.
  void change_points(const std::function<void(DicomItem point)>& change) {
    edit(study_.plan(), [&](DicomItem plan) {
      for (DicomItem& beam : plan.items(DCM_BeamSequence)) change(beam.items(DCM_ControlPointSequence).front());
    });
  }
  void change_images(const std::function<void(DicomItem image)>& change) {
    for (const int n : {0, 1}) edit(study_.image(n), change);
  }
  void set_couch(double planned_deg, double imaged_deg) {
    change_points([&](DicomItem point) { point.put(DCM_PatientSupportAngle, planned_deg); });
    change_images([&](DicomItem image) { image.put(DCM_PatientSupportAngle, imaged_deg); });
  }
  // Of X-ray 1; its beam has 0.
  void set_gantry(double imaged_deg) {
    edit(study_.image(0), [&](DicomItem image) {
      image.put(DCM_GantryAngle, imaged_deg);
      for (DicomItem& exposure : image.items(DCM_ExposureSequence))
        if (exposure.has_value(DCM_GantryAngle)) exposure.put(DCM_GantryAngle, imaged_deg);
    });
  }

  // What makes the result a review; what is only told stands in warnings_.
  std::string doubts(std::optional<double> gantry_offset_deg = {}, const Allowances& allowed = {}) {
    StudyRequest request{.parts = {.study = study_.path()}, .allowed = allowed};
    if (gantry_offset_deg)
      request.machine = MachineProfile{
          .path = "", .name = "M", .sha256 = "", .rules = {{.gantry_angle_offset_deg = gantry_offset_deg}}};
    Notes notes;
    const Study study = load_study(request, notes, [](std::size_t, std::size_t) {});
    warnings_ = fmt::format("{}", fmt::join(notes.warnings, "\n"));
    overrides_ = fmt::format("{}", fmt::join(notes.overrides, "\n"));
    return fmt::format("{}", fmt::join(study.doubts, "\n"));
  }

  SmallStudy study_;
  std::string warnings_, overrides_;
};

TEST_F(PlannedPoseTest, ACouchAngleWithAnotherSignIsADoubt) {
  set_couch(6.0, 354.0);
  EXPECT_THAT(doubts(),
              HasSubstr("beam 1 of the plan has couch angle 6.0 degrees, the images -6.0 degrees; the images' "
                        "counts: one is the mirror image of the other (another sign, or 360 - x)"));
  EXPECT_THAT(doubts({}, {{"plan-mismatch", "measured at the couch"}}), IsEmpty());
  EXPECT_THAT(overrides_, HasSubstr("couch angle 6.0 degrees"));
  set_couch(2.2, 357.8);
  EXPECT_THAT(doubts(), HasSubstr("mirror image")) << "although 4.4 degrees are less than 5";
  set_couch(-30.0, 30.0);
  EXPECT_THAT(doubts(), HasSubstr("mirror image"));
  set_couch(0.0, 180.0);
  EXPECT_THAT(doubts(), HasSubstr("another scale (180 - x)"));
}

// A correction of yaw by the couch, and the mirror of next to nothing.
TEST_F(PlannedPoseTest, ACorrectionOfTheCouchIsANote) {
  for (const auto& [planned_deg, imaged_deg] :
       {std::pair(0.0, 3.0), {1.5, 358.5}, {90.2, 89.8}, {6.0, 2.0}, {10.0, 5.0}}) {
    set_couch(planned_deg, imaged_deg);
    EXPECT_THAT(doubts(), IsEmpty()) << planned_deg;
    EXPECT_THAT(warnings_, HasSubstr("of the plan has couch angle")) << planned_deg;
  }
  set_couch(90.0, 90.0);
  EXPECT_THAT(doubts(), IsEmpty());
  EXPECT_THAT(warnings_, Not(HasSubstr("couch angle")));
}

TEST_F(PlannedPoseTest, ACouchMoreThanFiveDegreesOffIsADoubt) {
  set_couch(0.0, 5.5);
  EXPECT_THAT(doubts(), HasSubstr("beam 2 of the plan has couch angle 0.0 degrees, the images 5.5 degrees"));
  set_couch(0.0, 0.0);
  change_points([](DicomItem point) { point.put(DCM_TableTopEccentricAngle, 8.0); });
  EXPECT_THAT(doubts(), HasSubstr("couch angle 8.0 degrees"));
  change_points([](DicomItem point) {
    point.put(DCM_TableTopEccentricAngle, 0.0);
    point.put(DCM_TableTopPitchAngle, 6.0);
  });
  EXPECT_THAT(doubts(), HasSubstr("couch pitch 6.0 degrees"));
}

// Non-coplanar beams: an X-ray that names none may be of any.
TEST_F(PlannedPoseTest, WhereXraysNameNoBeamOneThatFitsIsEnough) {
  change_images([](DicomItem image) {
    for (DicomItem& reference : image.items(DCM_ReferencedRTPlanSequence)) reference.erase(DCM_ReferencedBeamNumber);
    image.erase(DCM_ReferencedBeamNumber);
  });
  edit(study_.plan(), [](DicomItem plan) {
    plan.items(DCM_BeamSequence)[1].items(DCM_ControlPointSequence).front().put(DCM_PatientSupportAngle, 30.0);
  });
  EXPECT_THAT(doubts(), IsEmpty());
  EXPECT_THAT(warnings_, HasSubstr("beam 2 of the plan has couch angle 30.0 degrees"));
  set_couch(30.0, 0.0);
  EXPECT_THAT(doubts(), HasSubstr("beam 1 of the plan has couch angle 30.0 degrees"));
}

TEST_F(PlannedPoseTest, AGantryThatIsNotTheBeamsIsADoubt) {
  set_gantry(359.2);
  EXPECT_THAT(doubts(), IsEmpty());
  set_gantry(8.0);
  EXPECT_EQ(
      doubts(),
      "KV_G000: GantryAngle (300A,011E) is 8.0 degrees, that of its beam 1 in the plan 0.0 degrees: the X-ray may "
      "be another beam's, or one of the angles may be wrong (--allow plan-mismatch=REASON)");
  edit(study_.plan(), [](DicomItem plan) {
    plan.items(DCM_BeamSequence)[0].items(DCM_ControlPointSequence).front().put(DCM_GantryAngle, 352.0);
  });
  EXPECT_THAT(doubts(),
              HasSubstr("that of its beam 1 in the plan 352.0 degrees: one is the mirror image of the other"));
}

TEST_F(PlannedPoseTest, AnArcHasNoAngleToContradict) {
  edit(study_.plan(), [](DicomItem plan) {
    plan.items(DCM_BeamSequence)[0].append_item(DCM_ControlPointSequence).put(DCM_GantryAngle, 179.0);
  });
  set_gantry(8.0);
  EXPECT_THAT(doubts(), IsEmpty());
}

// The source of a kV arm stands 90 degrees beside the gantry head; plans name either. What a profile says is no doubt.
TEST_F(PlannedPoseTest, NinetyDegreesAreAskedOfTheMachineProfile) {
  set_gantry(270.0);
  EXPECT_THAT(doubts(),
              HasSubstr("exactly 90 degrees apart, as the source of a kV arm is from the gantry head. A machine "
                        "profile says where the source stands (gantry_angle_offset_deg, --machine FILE)"));
  edit(study_.image(1), [](DicomItem image) {
    image.put(DCM_GantryAngle, 0.0);
    for (DicomItem& exposure : image.items(DCM_ExposureSequence))
      if (exposure.has_value(DCM_GantryAngle)) exposure.put(DCM_GantryAngle, 0.0);
  });
  EXPECT_THAT(doubts(90.0), IsEmpty()) << "the beams name the source";
  EXPECT_THAT(doubts(0.0), IsEmpty()) << "the beams name the gantry head, the X-rays the source";
  EXPECT_THAT(doubts(-90.0), HasSubstr("with the offset of the machine profile"));
  set_gantry(0.0);
  edit(study_.image(1), [](DicomItem image) {
    image.put(DCM_GantryAngle, 90.0);
    for (DicomItem& exposure : image.items(DCM_ExposureSequence))
      if (exposure.has_value(DCM_GantryAngle)) exposure.put(DCM_GantryAngle, 90.0);
  });
  EXPECT_THAT(doubts(90.0), IsEmpty()) << "beams and X-rays name the gantry head";
}

}  // namespace
}  // namespace isoshift::planned_pose_test
