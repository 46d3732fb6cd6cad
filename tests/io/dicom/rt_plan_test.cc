#include "io/dicom/rt_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"

namespace isoshift::rt_plan_test {
namespace {

using testing::HasSubstr;

class RtPlanTest : public testing::Test {
 protected:
  void change_beam(int number, const std::function<void(DicomItem control_point)>& change) {
    edit(study_.plan(), [&](DicomItem d) {
      change(d.items(DCM_BeamSequence)[static_cast<std::size_t>(number - 1)].items(DCM_ControlPointSequence).front());
    });
  }

  std::string error_of(const std::function<void(const RtPlan&)>& use) {
    try {
      use(read_rt_plan(study_.plan()));
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  SmallStudy study_;
};

TEST_F(RtPlanTest, ReadsIsocenterPositionAndCouchOfEveryBeam) {
  const RtPlan plan = read_rt_plan(study_.plan());
  ASSERT_EQ(plan.beams.size(), 2U);
  EXPECT_EQ(plan.beams[1].name, "KV_G090");
  EXPECT_EQ(plan.beams[1].patient_position, "HFS");
  EXPECT_EQ(plan.beams[1].support_angle_deg, 0.0);
  EXPECT_THAT(common_isocenter(plan, plan.beams), VectorNear(Eigen::Vector3d(-12.5, 38, -410), 1e-12));
}

TEST_F(RtPlanTest, TwoBeamsOfOneNumberAreRefused) {
  edit(study_.plan(), [](DicomItem plan) {
    plan.items(DCM_BeamSequence)[1].put(DCM_BeamNumber, plan.items(DCM_BeamSequence)[0].required_text(DCM_BeamNumber));
  });
  EXPECT_THAT(error_of([](const RtPlan&) {}), HasSubstr("BeamNumber (300A,00C0) 1 occurs twice"));
}

TEST_F(RtPlanTest, ASetupThatIsNotThereOrThereTwiceIsRefused) {
  edit(study_.plan(),
       [](DicomItem plan) { plan.items(DCM_BeamSequence).front().put(DCM_ReferencedPatientSetupNumber, 9.0); });
  EXPECT_THAT(error_of([](const RtPlan&) {}), HasSubstr("ReferencedPatientSetupNumber (300C,006A) is 9, a number that "
                                                        "0 items of PatientSetupSequence (300A,0180) have"));
  edit(study_.plan(), [](DicomItem plan) {
    const double first = plan.items(DCM_PatientSetupSequence).front().required_number(DCM_PatientSetupNumber);
    plan.items(DCM_BeamSequence).front().put(DCM_ReferencedPatientSetupNumber, first);
    plan.append_item(DCM_PatientSetupSequence).put(DCM_PatientSetupNumber, first);
  });
  EXPECT_THAT(error_of([](const RtPlan&) {}), HasSubstr("a number that 2 items of PatientSetupSequence"));
}

TEST_F(RtPlanTest, ReadsWhatThePrescriptionSpeaksOf) {
  EXPECT_TRUE(read_rt_plan(study_.plan()).dose_references.empty());
  edit(study_.plan(), [](DicomItem plan) {
    DicomItem target = plan.append_item(DCM_DoseReferenceSequence);
    target.put(DCM_DoseReferenceNumber, "3");
    target.put(DCM_DoseReferenceType, "TARGET");
    target.put(DCM_ReferencedROINumber, "12");
    DicomItem site = plan.append_item(DCM_DoseReferenceSequence);
    site.put(DCM_DoseReferenceType, "TARGET");
  });
  const RtPlan plan = read_rt_plan(study_.plan());
  ASSERT_EQ(plan.dose_references.size(), 2U);
  EXPECT_EQ(plan.dose_references[0].number, 3);
  EXPECT_EQ(plan.dose_references[0].type, "TARGET");
  EXPECT_EQ(plan.dose_references[0].roi_number, 12);
  EXPECT_FALSE(plan.dose_references[1].roi_number);
}

TEST_F(RtPlanTest, DifferentIsocentersAreRefusedUnlessTheBeamIsNamed) {
  change_beam(2, [](DicomItem point) { point.put(DCM_IsocenterPosition, "-12.5\\48\\-410"); });
  EXPECT_THAT(
      error_of([](const RtPlan& plan) { common_isocenter(plan, plan.beams); }),
      HasSubstr("beams have different isocenters (IsocenterPosition (300A,012C)): (-12.5, 38, -410) and (-12.5, 48, "
                "-410) mm.\n       Say which one the patient was set up to: --isocenter X,Y,Z"));
  const RtPlan plan = read_rt_plan(study_.plan());
  EXPECT_THAT(common_isocenter(plan, std::array{beam_numbered(plan, 2)}),
              VectorNear(Eigen::Vector3d(-12.5, 48, -410), 1e-12));
}

TEST_F(RtPlanTest, AMissingIsocenterIsNamedWithItsSwitch) {
  change_beam(1, [](DicomItem point) { point.put(DCM_IsocenterPosition, ""); });
  EXPECT_EQ(error_of([](const RtPlan& plan) { common_isocenter(plan, plan.beams); }),
            "no error");  // the other beam has it
  change_beam(2, [](DicomItem point) { point.erase(DCM_IsocenterPosition); });
  EXPECT_THAT(error_of([](const RtPlan& plan) { common_isocenter(plan, plan.beams); }),
              HasSubstr("Supply it: --isocenter X,Y,Z"));
}

TEST_F(RtPlanTest, ABeamThatIsNotThereIsNamed) {
  EXPECT_THAT(error_of([](const RtPlan& plan) { beam_numbered(plan, 7); }),
              HasSubstr("has no beam 7, to which an image refers"));
}

// A static beam and one whose gantry goes once around, of two control points each.
TEST_F(RtPlanTest, OnlyAGantryThatStandsStillHasAnAngle) {
  const auto add_point = [](DicomItem plan, std::size_t beam, double gantry_deg) {
    plan.items(DCM_BeamSequence)[beam].append_item(DCM_ControlPointSequence).put(DCM_GantryAngle, gantry_deg);
  };
  edit(study_.plan(), [&](DicomItem plan) {
    add_point(plan, 0, 0.0);
    add_point(plan, 1, 450.0);
    plan.items(DCM_BeamSequence)[1].items(DCM_ControlPointSequence).front().put(DCM_GantryRotationDirection, "CW");
  });
  EXPECT_EQ(read_rt_plan(study_.plan()).beams[0].gantry_deg, 0.0);
  EXPECT_FALSE(read_rt_plan(study_.plan()).beams[1].gantry_deg);
  edit(study_.plan(), [&](DicomItem plan) { add_point(plan, 0, 40.0); });
  EXPECT_FALSE(read_rt_plan(study_.plan()).beams[0].gantry_deg);
}

// An ion plan holds the same under other names.
TEST_F(RtPlanTest, IonPlansAreReadAndChairsRefused) {
  edit(study_.plan(), [](DicomItem d) {
    d.put(DCM_SOPClassUID, "1.2.840.10008.5.1.4.1.1.481.8");
    DicomItem beam = d.append_item(DCM_IonBeamSequence);
    beam.put(DCM_BeamNumber, 1);
    beam.put(DCM_PatientSupportType, "TABLE");
    beam.put(DCM_ReferencedPatientSetupNumber, 1);
    beam.append_item(DCM_IonControlPointSequence).put(DCM_IsocenterPosition, "1\\2\\3");
    d.erase(DCM_BeamSequence);
  });
  const RtPlan plan = read_rt_plan(study_.plan());
  EXPECT_THAT(common_isocenter(plan, plan.beams), VectorNear(Eigen::Vector3d(1, 2, 3), 1e-12));
  EXPECT_EQ(plan.beams.front().patient_position, "HFS");
  edit(study_.plan(), [](DicomItem d) { d.items(DCM_IonBeamSequence).front().put(DCM_PatientSupportType, "CHAIR"); });
  EXPECT_THAT(error_of([](const RtPlan&) {}), HasSubstr("PatientSupportType (300A,0350) is CHAIR, expected TABLE"));
}

TEST_F(RtPlanTest, ASetupDisplacementAndAMissingApprovalAreWarnedOf) {
  edit(study_.plan(), [](DicomItem d) {
    d.put(DCM_ApprovalStatus, "UNAPPROVED");
    DicomItem setup = d.items(DCM_PatientSetupSequence).front();
    setup.put(DCM_TableTopVerticalSetupDisplacement, -12.0);
    d.append_item(DCM_PatientSetupSequence).put(DCM_PatientSetupNumber, 77);  // of no beam
  });
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("of the plan moves the table by (-12.0, 0.0, 0.0) mm"));
  EXPECT_THAT(outcome.err, HasSubstr("the plan is not approved (ApprovalStatus (300E,0002) is \"UNAPPROVED\")"));
}

TEST_F(RtPlanTest, AnIsocenterThatMovesIsRefused) {
  edit(study_.plan(), [](DicomItem d) {
    DicomItem beam = d.items(DCM_BeamSequence)[0];
    beam.append_item(DCM_ControlPointSequence).put(DCM_IsocenterPosition, std::array{1.0, 2.0, 3.0});
  });
  EXPECT_THAT(error_of([](const RtPlan&) {}), HasSubstr("beams with a moving isocenter are not supported"));
}

}  // namespace
}  // namespace isoshift::rt_plan_test
