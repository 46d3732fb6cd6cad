// What files and switches say against each other, and what nobody knows of a setup.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/small_study.h"

namespace isoshift::contradictions_command_test {
namespace {

using testing::HasSubstr;

class ContradictionsCommandTest : public testing::Test {
 protected:
  // One more beam, which treats.
  static DicomItem treating_beam(DicomItem plan) {
    DicomItem beam = plan.append_item(DCM_BeamSequence);
    beam.put(DCM_BeamNumber, 9.0);
    beam.put(DCM_TreatmentDeliveryType, "TREATMENT");
    return beam;
  }

  SmallStudy study_;
};

TEST_F(ContradictionsCommandTest, TheSameXrayTwiceIsOneView) {
  std::filesystem::copy(study_.image(0), study_.path() / "RTIMAGE" / "again.dcm");
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(result_of(study_)["views"].size(), 2U);
  EXPECT_THAT(outcome.err, HasSubstr("left aside: "));
  EXPECT_THAT(result_of(study_)["left_aside"].dump(), HasSubstr("the same X-ray as"));
}

TEST_F(ContradictionsCommandTest, AViewWithoutATimeIsWarnedOfAndDoesNotHideTheOthers) {
  edit(study_.image(0), [](DicomItem d) {
    d.erase(DCM_AcquisitionTime);
    d.erase(DCM_ContentTime);
  });
  register_study(study_);
  EXPECT_THAT(result_of(study_)["warnings"].dump(), HasSubstr("KV_G000: AcquisitionTime (0008,0032) is missing"));
}

// Whether the couch moved in between nobody knows without its read-outs, which the phantom's X-rays do not have.
TEST_F(ContradictionsCommandTest, ViewsFarApartWithoutTableReadOutsNeedAReview) {
  const auto take_second_at = [&](const char* time) {
    edit(study_.image(1), [&](DicomItem d) { d.put(DCM_AcquisitionTime, time); });
  };
  const auto reasons = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--overwrite"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    register_study(study_, arguments);
    return fmt::format("{} {}", result_of(study_)["verdict"].get<std::string>(), result_of(study_)["reasons"].dump());
  };
  take_second_at("101659");
  EXPECT_EQ(reasons({}), "accepted []");
  take_second_at("101710");
  EXPECT_EQ(reasons({}),
            "review [\"KV_G090 was taken 130 s after KV_G000, more than 120 s: without measured table positions in all "
            "views it is not known whether the table moved (--allow time-span=REASON)\"]");
  EXPECT_EQ(reasons({"--allow", "time-span=the couch stood still"}), "accepted []");
  EXPECT_THAT(result_of(study_)["overrides"].dump(), HasSubstr("130 s after KV_G000"));
  const std::filesystem::path site = study_.path().parent_path() / "site.json";
  std::ofstream(site) << R"({"site_file": 1, "name": "S", "sessions": {"views": 2, "quiet_s": 1, "max_span_s": 300}})";
  EXPECT_EQ(reasons({"--site", site.string()}), "accepted []");
  for (const int n : {0, 1})
    edit(study_.image(n), [](DicomItem d) {
      d.put(DCM_TableTopLateralPosition, 1.0);
      d.put(DCM_TableTopLongitudinalPosition, 2.0);
      d.put(DCM_TableTopVerticalPosition, 3.0);
    });
  EXPECT_EQ(reasons({}), "accepted []");
}

TEST_F(ContradictionsCommandTest, AViewTakenTwiceNeedsAReviewWhereTheTableIsUnknown) {
  const std::filesystem::path again = study_.path() / "RTIMAGE" / "AGAIN.dcm";
  std::filesystem::copy_file(study_.image(1), again);
  edit(again, [](DicomItem d) {
    d.put(DCM_SOPInstanceUID, "1.2.3.4");
    d.put(DCM_AcquisitionTime, "101530");
  });
  EXPECT_EQ(register_study(study_).exit_status, 3);
  EXPECT_THAT(result_of(study_)["reasons"].dump(), HasSubstr("AGAIN.dcm show the same view"));
}

// What nobody knows is not taken for granted.
TEST_F(ContradictionsCommandTest, ViewsThatMayBeOfTwoSetupsNeedAReview) {
  const auto reasons = [&](const std::function<void(DicomItem)>& change) {
    const SmallStudy study;
    edit(study.image(1), change);
    register_study(study);
    return result_of(study)["reasons"].dump();
  };
  EXPECT_THAT(reasons([](DicomItem d) {
                for (const DcmTagKey& tag : {DCM_AcquisitionTime, DCM_ContentTime}) d.erase(tag);
              }),
              HasSubstr("KV_G090: when it was taken is unknown"));
  EXPECT_THAT(reasons([](DicomItem d) { d.put(DCM_AcquisitionTime, "10 55"); }),
              HasSubstr("KV_G090: when it was taken is unknown"));
  EXPECT_THAT(reasons([](DicomItem d) { d.put(DCM_AcquisitionTime, "10:18:00"); }), HasSubstr("was taken 180 s after"));
  EXPECT_THAT(reasons([](DicomItem d) { d.put(DCM_RadiationMachineName, "LINAC2"); }), HasSubstr("LINAC2"));
  EXPECT_THAT(reasons([](DicomItem d) { d.put(DCM_TableTopEccentricAngle, 3.0); }),
              HasSubstr("is 3 degrees in KV_G090 and missing in KV_G000"));
}

// A couch returns to its place every day.
TEST_F(ContradictionsCommandTest, ATableThatStandsWhereItStoodDoesNotReplaceTheTimes) {
  for (const int n : {0, 1})
    edit(study_.image(n), [&](DicomItem d) {
      d.put(DCM_TableTopLateralPosition, 10.0);
      d.put(DCM_TableTopLongitudinalPosition, 812.0);
      d.put(DCM_TableTopVerticalPosition, -150.0);
      d.put(DCM_AcquisitionTime, n == 0 ? "1015" : "1601");  // hours apart, without seconds
    });
  EXPECT_EQ(register_study(study_).exit_status, 3);
  EXPECT_THAT(result_of(study_)["reasons"].dump(), HasSubstr("so it is not known whether the views show one setup"));
}

TEST_F(ContradictionsCommandTest, ViewsOfTwoFractionsNeedAReview) {
  for (const int n : {0, 1}) edit(study_.image(n), [&](DicomItem d) { d.put(DCM_FractionNumber, 6.0 + n); });
  EXPECT_EQ(register_study(study_).exit_status, 3);
  EXPECT_THAT(result_of(study_)["reasons"].dump(), HasSubstr("KV_G090 is of fraction 7, KV_G000 of 6"));
}

// The isocenter, in the frame of the CT, tells of a second plan or of a move that no read-out tells.
TEST_F(ContradictionsCommandTest, ViewsOfTwoIsocentersNeedAReview) {
  const auto reasons = [](double apart_mm) {
    const SmallStudy study;
    for (const int n : {0, 1})
      edit(study.image(n), [&](DicomItem d) {
        const std::array isocenter_mm = {0.0, 0.0, n * apart_mm};
        d.put(DCM_IsocenterPosition, isocenter_mm);
      });
    register_study(study);
    return result_of(study)["reasons"].dump();
  };
  EXPECT_THAT(reasons(0.1), testing::Not(HasSubstr("different isocenters")));
  EXPECT_THAT(reasons(2.0), HasSubstr("KV_G090 and KV_G000 have different isocenters"));
}

// Programs that know no table position write zeros or huge numbers, or the planned position: whether the table moved in
// the three minutes is not known.
TEST_F(ContradictionsCommandTest, PlaceholdersAreNoTablePosition) {
  const auto reasons = [](double longitudinal_mm, const char* origin = "ACTUAL") {
    const SmallStudy study;
    for (const int n : {0, 1})
      edit(study.image(n), [&](DicomItem d) {
        d.put(DCM_TableTopLateralPosition, 0.0);
        d.put(DCM_TableTopLongitudinalPosition, longitudinal_mm);
        d.put(DCM_TableTopVerticalPosition, longitudinal_mm == 0.0 ? 0.0 : -152.5);
        d.put(DCM_ReportedValuesOrigin, origin);
      });
    edit(study.image(1), [](DicomItem d) { d.put(DCM_AcquisitionTime, "101800"); });
    register_study(study, {"--allow", "planned-geometry=a test"});
    return result_of(study)["reasons"].dump();
  };
  EXPECT_THAT(reasons(0.0), HasSubstr("without measured table positions in all views"));
  EXPECT_THAT(reasons(99999.0), HasSubstr("without measured table positions in all views"));
  EXPECT_THAT(reasons(812.0), testing::Not(HasSubstr("table positions")));
  EXPECT_THAT(reasons(812.0, "PLAN"), HasSubstr("without measured table positions in all views"));
}

TEST_F(ContradictionsCommandTest, ASwitchThatContradictsAReadOutNeedsAReview) {
  const CommandOutcome outcome = register_study(study_, {"--couch-pitch", "1"});
  EXPECT_EQ(outcome.exit_status, 3) << outcome.err;
  EXPECT_THAT(result_of(study_)["reasons"].dump(), HasSubstr("--couch-pitch 1 contradicts KV_G000"));
}

TEST_F(ContradictionsCommandTest, AnAngleTypedInAgainstTheMeasuredOneNeedsAReviewUnlessAllowed) {
  const std::vector<std::string> typed = {"--gantry-angle", "KV_G000=2"};
  EXPECT_EQ(register_study(study_, typed).exit_status, 3);
  EXPECT_THAT(result_of(study_)["reasons"].dump(),
              HasSubstr("--gantry-angle KV_G000=2 contradicts KV_G000: GantryAngle (300A,011E) is 0 (--allow "
                        "planned-geometry=REASON)"));
  register_study(study_, {"--gantry-angle", "KV_G000=2", "--allow", "planned-geometry=a test", "--overwrite"});
  EXPECT_THAT(result_of(study_)["reasons"].dump(), testing::Not(HasSubstr("contradicts")));
  EXPECT_THAT(result_of(study_)["overrides"].dump(), HasSubstr("(allowed by planned-geometry: a test)"));
}

TEST_F(ContradictionsCommandTest, AnIsocenterThatIsNotThePlansNeedsAReview) {
  EXPECT_EQ(register_study(study_, {"--isocenter", "-2.5,38,-410"}).exit_status, 3);
  EXPECT_THAT(result_of(study_)["reasons"].dump(), HasSubstr("--isocenter -2.5,38,-410 contradicts the plan"));
  EXPECT_EQ(register_study(study_, {"--isocenter", "-12.5,38,-410.2", "--overwrite"}).exit_status, 0);
}

TEST_F(ContradictionsCommandTest, ABeamThatTreatsElsewhereThanItWasImagedNeedsAReview) {
  edit(study_.plan(), [](DicomItem plan) {
    treating_beam(plan).append_item(DCM_ControlPointSequence).put(DCM_IsocenterPosition, "-2.5\\38\\-410");
  });
  EXPECT_EQ(register_study(study_).exit_status, 3);
  EXPECT_THAT(result_of(study_)["reasons"].dump(),
              HasSubstr("no beam that treats has it: that of beam 9 is (-2.5, 38, -410) mm"));
  EXPECT_EQ(register_study(study_, {"--isocenter", "-12.5,38,-410", "--overwrite"}).exit_status, 3);
}

TEST_F(ContradictionsCommandTest, AnIsocenterTypedInSettlesNoPosition) {
  edit(study_.plan(), [](DicomItem plan) {
    DicomItem setup = plan.append_item(DCM_PatientSetupSequence);
    setup.put(DCM_PatientSetupNumber, 2.0);
    setup.put(DCM_PatientPosition, "HFP");
    treating_beam(plan).put(DCM_ReferencedPatientSetupNumber, 2.0);
  });
  EXPECT_EQ(register_study(study_, {"--isocenter", "-12.5,38,-410"}).exit_status, 3);
  EXPECT_THAT(result_of(study_)["reasons"].dump(), HasSubstr("beam 9 of the plan treats in HFP"));
}

TEST_F(ContradictionsCommandTest, APlanForAnotherTableIsWarnedOf) {
  edit(study_.plan(), [](DicomItem plan) {
    DicomItem first = plan.items(DCM_BeamSequence)[0].items(DCM_ControlPointSequence).front();
    first.put(DCM_TableTopPitchAngle, 2.0);
    first.put(DCM_TableTopRollAngle, 359.95);
    plan.items(DCM_BeamSequence)[1].items(DCM_ControlPointSequence).front().put(DCM_TableTopEccentricAngle, 5.0);
  });
  EXPECT_EQ(register_study(study_).exit_status, 0);
  const std::string warnings = result_of(study_)["warnings"].dump();
  EXPECT_THAT(warnings, HasSubstr("beam 1 of the plan has couch pitch 2.0 degrees, the images 0.0 degrees"));
  EXPECT_THAT(warnings, HasSubstr("beam 2 of the plan has couch angle 5.0 degrees, the images 0.0 degrees"));
  EXPECT_THAT(warnings, testing::Not(HasSubstr("couch roll")));
}

// A couch angle on another scale turns the answer by twice its value. A site decides by its own action level.
TEST_F(ContradictionsCommandTest, ARotationAboveFiveDegreesNeedsAReviewUnlessTheSiteHasALimit) {
  const auto reasons = [&](double rz_deg, const std::string& action_levels) {
    PhantomOptions phantom = small_phantom();
    phantom.placement.rotation_deg = Eigen::Vector3d(0.5, -0.5, rz_deg);
    const SmallStudy study(phantom);
    const std::filesystem::path site = study.path().parent_path() / "site.json";
    std::ofstream(site) << R"({"site_file": 1, "name": "S")" << action_levels << "}";
    register_study(study, action_levels == "no site" ? std::vector<std::string>()
                                                     : std::vector<std::string>{"--site", site.string()});
    return result_of(study)["reasons"].dump();
  };
  EXPECT_THAT(reasons(5.6, "no site"),
              HasSubstr("the couch would have to turn by -5.6 degrees (yaw), more than 5 degrees"));
  for (const char* without_rotation : {"", R"(, "action_levels": {"default": {"vector_mm": 4}})"})
    EXPECT_THAT(reasons(5.6, without_rotation), HasSubstr("the couch would have to turn by -5.6 degrees (yaw)"));
  EXPECT_THAT(reasons(5.6, R"(, "action_levels": {"default": {"rotation_deg": 2}})"),
              testing::Not(HasSubstr("the couch would have to turn")));
  EXPECT_THAT(reasons(-4.6, "no site"), testing::Not(HasSubstr("the couch would have to turn")));
}

TEST_F(ContradictionsCommandTest, ATruthAboutAnotherSetupIsRefusedBeforeAnythingIsWritten) {
  std::ofstream(study_.truth(), std::ios::trunc)
      << R"({"patient_position": "FFS", "setup_error_room": {"translation_mm": [0, 0, 0],
             "rotation_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}})";
  const CommandOutcome outcome = register_study(study_, {"--truth", study_.truth().string()});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("its patient position is FFS, and that of the study HFS"));
  EXPECT_FALSE(std::filesystem::exists(study_.output()));
}

TEST_F(ContradictionsCommandTest, AnXrayWithTheUidOfThePlanIsRefused) {
  std::string uid;
  edit(study_.plan(), [&](DicomItem plan) { uid = plan.required_uid(DCM_SOPInstanceUID); });
  edit(study_.image(0), [&](DicomItem d) { d.put(DCM_SOPInstanceUID, uid); });
  EXPECT_THAT(register_study(study_).err, HasSubstr("KV_G000.dcm: has the SOPInstanceUID (0008,0018) of"));
}

TEST_F(ContradictionsCommandTest, ContradictionsThatDecideNothingAreWarnedOf) {
  edit(study_.image(0), [](DicomItem d) {
    d.put(DCM_PatientSex, "M");
    d.put(DCM_ApprovalStatus, "REJECTED");
  });
  edit(study_.plan(), [](DicomItem plan) {
    plan.put(DCM_PatientSex, "F");
    plan.put(DCM_RTPlanDate, "20270101");
    for (DicomItem& beam : plan.items(DCM_BeamSequence)) beam.put(DCM_TreatmentMachineName, "OTHER");
  });
  for (int k = 0; std::filesystem::exists(study_.ct_slice(k)); ++k)
    edit(study_.ct_slice(k), [](DicomItem d) { d.put(DCM_PatientSex, "F"); });
  const std::string err = register_study(study_).err;
  EXPECT_THAT(err, HasSubstr("KV_G000.dcm: ApprovalStatus (300E,0002) is REJECTED"));
  EXPECT_THAT(err, HasSubstr("KV_G000.dcm: PatientSex (0010,0040) is M, that of the CT is F"));
  EXPECT_THAT(err, HasSubstr("KV_G000: was taken on 20260301, before the plan of 20270101"));
  EXPECT_THAT(err, HasSubstr("the plan's beams are for \"OTHER\" (TreatmentMachineName (300A,00B2))"));
}

TEST_F(ContradictionsCommandTest, AnglesThatNoCouchHasAreRefused) {
  for (const auto& [flag, angle] :
       {std::pair("--couch-angle", "400"), std::pair("--couch-pitch", "90"), std::pair("--couch-roll", "-60")}) {
    const CommandOutcome outcome = register_study(study_, {flag, angle});
    EXPECT_EQ(outcome.exit_status, 2) << flag;
    EXPECT_THAT(outcome.err, HasSubstr(fmt::format("{}: {}, expected degrees from -", flag, angle)));
  }
  EXPECT_EQ(register_study(study_, {"--couch-pitch", "359.95"}).exit_status, 0);
}

// A switch supplies what is missing; a table that was seen to turn is refused whatever a switch says.
TEST_F(ContradictionsCommandTest, ASwitchHidesNoMoveOfTheTable) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_PatientSupportAngle, 3.0); });
  const CommandOutcome outcome = register_study(study_, {"--couch-angle", "0"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("the table turned by 3.0 degrees"));
}

}  // namespace
}  // namespace isoshift::contradictions_command_test
