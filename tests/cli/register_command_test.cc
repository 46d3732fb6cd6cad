#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "workflow/register/truth.h"

namespace isoshift::register_command_test {
namespace {

using testing::HasSubstr;

class RegisterCommandTest : public testing::Test {
 protected:
  nlohmann::json result() {
    std::ifstream file(study_.output() / "result.json");
    return nlohmann::json::parse(file);
  }

  SmallStudy study_;
};

// X-rays show what lies before and behind the sphere, and its DRR is a bright ball: intensities put it 45 mm off.
TEST(RegionCommandTest, ASphereInASpineIsRegistered) {
  const TemporaryFolder folder;
  const std::string study = (folder / "study").string();
  ASSERT_EQ(run_command({"phantom", "-o", study, "--anatomy", "spine", "--voxel-mm", "2", "--image-pixels", "256",
                         "--photons", "0", "--seed", "5"})
                .exit_status,
            0);
  const CommandOutcome outcome =
      run_command({"register", study, "-o", (folder / "out").string(), "--around-isocenter", "80"});
  EXPECT_THAT(read_setup_error(folder / "out" / "result.json"),
              PoseNear(read_setup_error(folder / "study" / "truth.json"), 0.5, 0.5))
      << outcome.err;
}

TEST_F(RegisterCommandTest, FindsTheSetupErrorFromTheFirstFileToTheLast) {
  SmallStudy study([] {
    PhantomOptions options = small_phantom();
    options.voxel_mm = 1.5;
    options.image_pixels = 256;
    return options;
  }());
  const CommandOutcome outcome = run_command(
      {"register", study.path().string(), "-o", study.output().string(), "--truth", study.truth().string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  // Slices of 2.25 mm and pixels of 1.07 mm at the isocenter: what the demo asks of the default phantom.
  EXPECT_THAT(read_setup_error(study.output() / "result.json"), PoseNear(read_setup_error(study.truth()), 0.3, 0.2));
  for (const char* name : {"report.txt", "report.csv", "report.pdf", "report.html", "report.dcm", "result.json",
                           "spatial_registration.dcm", "view1.png", "view2.png"})
    EXPECT_TRUE(std::filesystem::exists(study.output() / name)) << name;
  EXPECT_THAT(outcome.out, HasSubstr("VERDICT      ACCEPTED"));
  EXPECT_THAT(outcome.out, HasSubstr("SETUP ERROR BESIDE THE TRUTH"));
}

TEST_F(RegisterCommandTest, ResultFollowsItsSchema) {
  for (const auto& more : {std::vector<std::string>{}, {"--image", study_.image(0).string()}}) {
    register_study(study_, more);
    const CommandOutcome checked =
        run_shell(fmt::format("/usr/bin/python3 -m jsonschema -i {} {}/docs/result.schema.json",
                              (study_.output() / "result.json").string(), ISOSHIFT_SOURCE_DIR));
    EXPECT_EQ(checked.exit_status, 0) << checked.out;
    std::filesystem::remove_all(study_.output());
  }
}

TEST_F(RegisterCommandTest, JsonOnStdoutIsTheResultFile) {
  const CommandOutcome outcome = register_study(study_, {"--json"});
  EXPECT_EQ(nlohmann::json::parse(outcome.out), result());
}

TEST_F(RegisterCommandTest, OneViewIsReviewWithoutDepthAndWithoutRegistrationObject) {
  const CommandOutcome outcome =
      register_study(study_, {"--image", study_.image(0).string(), "--write-reg-for-review"});
  EXPECT_EQ(outcome.exit_status, 3);
  EXPECT_EQ(result()["verdict"], "review");
  EXPECT_TRUE(result()["setup_error"]["translation_mm"][2].is_null());  // gantry 0 looks along z
  EXPECT_FALSE(result()["setup_error"]["translation_mm"][0].is_null());
  EXPECT_TRUE(result()["couch_shift"]["vertical_mm"].is_null());
  EXPECT_FALSE(std::filesystem::exists(study_.output() / "spatial_registration.dcm"));
}

TEST_F(RegisterCommandTest, WhatNobodyMeasuredIsWrittenAsZeroOnlyOnRequest) {
  const CommandOutcome outcome = register_study(
      study_, {"--image", study_.image(0).string(), "--write-reg-for-review", "--accept-unobservable", "--json"});
  EXPECT_EQ(outcome.exit_status, 3);
  EXPECT_THAT(result()["overrides"].dump(),
              HasSubstr("which was not measured, is taken as 0 by --accept-unobservable"));
  const std::string written = (study_.output() / "spatial_registration.dcm").string();
  const CommandOutcome checked = run_command({"check", written, "--plan", study_.plan().string(), "--json"});
  const auto shift = nlohmann::json::parse(checked.out)["registrations"][0]["couch_shift"];
  EXPECT_NEAR(shift["vertical_mm"], 0.0, 1e-6);
  EXPECT_NEAR(shift["lateral_mm"], result()["couch_shift"]["lateral_mm"], 1e-6);
}

// A pose in a file, as a person has set it.
void write_pose(const std::filesystem::path& file, const Eigen::Isometry3d& setup_error) {
  const auto& r = setup_error.linear();
  const auto& t = setup_error.translation();
  const auto row = [&](int n) { return std::array{r(n, 0), r(n, 1), r(n, 2)}; };
  std::ofstream(file) << nlohmann::json{
      {"setup_error",
       {{"translation_mm", std::array{t.x(), t.y(), t.z()}}, {"rotation_matrix", std::array{row(0), row(1), row(2)}}}},
      {"set_by", "jdoe"}};
}

TEST_F(RegisterCommandTest, APoseSetByHandSaysSoEverywhereAndIsForReview) {
  const std::filesystem::path pose = study_.path() / "pose.json";
  const Eigen::Isometry3d truth = read_setup_error(study_.truth());
  write_pose(pose, truth);
  const CommandOutcome outcome =
      register_study(study_, {"--start", pose.string(), "--no-search", "--write-reg-for-review"});
  EXPECT_EQ(outcome.exit_status, 3) << outcome.err;
  EXPECT_THAT(read_setup_error(study_.output() / "result.json"), PoseNear(truth, 1e-6, 1e-6));
  EXPECT_THAT(outcome.out, HasSubstr("set by hand by jdoe, NOT SEARCHED"));
  EXPECT_THAT(outcome.out, HasSubstr("the pose was set, not searched"));
  EXPECT_EQ(result()["searched"], false);
  EXPECT_EQ(result()["start"]["set_by"], "jdoe");
  const DicomFile file = DicomFile::read(study_.output() / "spatial_registration.dcm", DicomFile::Extent::kWhole);
  EXPECT_EQ(file.dataset().text(DCM_ContentLabel), "SETUP_BY_HAND");
  EXPECT_EQ(file.dataset().text(DCM_ContentDescription), "SET BY HAND: REVIEW");
}

TEST_F(RegisterCommandTest, ASearchBeginsWhereTheFileSays) {
  const CommandOutcome first = register_study(study_);
  const Eigen::Isometry3d found = read_setup_error(study_.output() / "result.json");
  const std::filesystem::path pose = study_.path() / "pose.json";
  Eigen::Isometry3d near = Eigen::Isometry3d::Identity();
  near.translation() = Eigen::Vector3d(3.0, 2.0, -4.0);
  write_pose(pose, near * read_setup_error(study_.truth()));
  const CommandOutcome outcome = register_study(study_, {"--start", pose.string(), "--overwrite"});
  EXPECT_EQ(outcome.exit_status, first.exit_status) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("searched from a start set by hand by jdoe"));
  EXPECT_THAT(read_setup_error(study_.output() / "result.json"), PoseNear(found, 0.2, 0.3));
  // A result is a start, too.
  const std::filesystem::path before = study_.path() / "before.json";
  std::filesystem::copy_file(study_.output() / "result.json", before);
  EXPECT_EQ(register_study(study_, {"--start", before.string(), "--overwrite"}).exit_status, first.exit_status);
  EXPECT_TRUE(result()["start"]["set_by"].is_null());
  EXPECT_EQ(result()["start"]["file"], "before.json");
}

TEST_F(RegisterCommandTest, AStartThatCannotBeOneIsRefused) {
  const std::filesystem::path pose = study_.path() / "pose.json";
  const auto refusal = [&](const std::string& text) {
    std::ofstream(pose) << text;
    const CommandOutcome outcome = register_study(study_, {"--start", pose.string()});
    EXPECT_EQ(outcome.exit_status, 1) << text;
    EXPECT_FALSE(std::filesystem::exists(study_.output())) << text;
    EXPECT_THAT(outcome.err, HasSubstr(pose.string()));
    return outcome.err;
  };
  const std::string about = R"("setup_error": {"translation_mm": [1, 2, 3], "rotation_matrix": )",
                    straight = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]}";
  EXPECT_THAT(refusal("{}"), HasSubstr("holds no complete setup error"));
  EXPECT_THAT(refusal("no JSON"), HasSubstr("is not JSON"));
  EXPECT_THAT(refusal("{" + about + "[[1, 0, 0], [0, 1, 0], [0, 0, -1]]}}"), HasSubstr("is no rotation"));
  EXPECT_THAT(refusal("{" + about + straight + R"(, "patient": {"id": "Smith"}})"),
              HasSubstr("is of another patient than the study (PatientID)"));
  EXPECT_THAT(refusal("{" + about + straight + R"(, "isocenter_patient_mm": [1, 2, 3]})"),
              HasSubstr("its isocenter is (1.00, 2.00, 3.00)"));
  EXPECT_THAT(refusal("{" + about + straight + R"(, "patient_position": "HFP"})"),
              HasSubstr("its patient position is HFP, and that of the study HFS"));
  EXPECT_THAT(refusal("{" + about + straight + R"(, "couch_deg": 30})"),
              HasSubstr("its couch angle is 30.0 degrees, and that of the study 0.0"));
  EXPECT_THAT(refusal("{" + about + straight +
                      R"(, "table": {"support_deg": 0, "eccentric_deg": 0, "pitch_deg": 1, "roll_deg": 0}})"),
              HasSubstr("its couch pitch is 1.0 degrees"));
  EXPECT_THAT(refusal("{" + about + straight + R"(, "set_by": 3})"), HasSubstr("pose set by hand"));
  EXPECT_EQ(register_study(study_, {"--no-search", "--check-vertebrae"}).exit_status, 2);
}

TEST_F(RegisterCommandTest, ASiteFileDecidesAboutActionAndCouch) {
  const std::filesystem::path site = study_.path() / "site.json";
  std::ofstream(site) << R"({"site_file": 1, "name": "Linac 3", "action_levels": {"head": {"translation_mm": 1}},
                             "couch": {"degrees_of_freedom": 4}})";
  draw(
      study_,
      {{"TARGET",
        {rectangle({-12, 38, -416}, 60, 60), rectangle({-12, 38, -410}, 60, 60), rectangle({-12, 38, -404}, 60, 60)}}});
  const CommandOutcome outcome =
      register_study(study_, {"--site", site.string(), "--anatomy", "head", "--structure", "TARGET"});
  EXPECT_EQ(outcome.exit_status, 3) << outcome.err;
  EXPECT_EQ(result()["site"]["name"], "Linac 3");
  if (result()["verdict"] != "rejected") {
    EXPECT_EQ(result()["action"], "exceeds");
    EXPECT_EQ(result()["left_over"].back()["at"], "centroid of TARGET");
    EXPECT_EQ(result()["couch_applied"]["brings_right"], result()["target"]["name"]);
  }
  EXPECT_FALSE(result()["views"][0]["picture"]["structures"][0]["planned"].empty());
  EXPECT_EQ(register_study(study_, {"--overwrite", "--anatomy", "head"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--overwrite", "--site", site.string(), "--anatomy", "pelvis"}).exit_status, 2);
}

TEST_F(RegisterCommandTest, ReportMakesAllFormatsAgain) {
  register_study(study_);
  const auto before = result();
  const std::string folder = study_.output().string();
  EXPECT_EQ(run_command({"report", folder}).exit_status, 1);  // nothing is overwritten unasked
  for (const char* name : {"report.txt", "report.pdf", "report.html", "report.csv", "report.dcm", "view1.png"})
    std::filesystem::remove(study_.output() / name);
  const CommandOutcome outcome = run_command({"report", folder, "--overwrite"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_EQ(result(), before);
  for (const char* name :
       {"report.txt", "report.pdf", "report.html", "report.csv", "report.dcm", "view1.png", "spatial_registration.dcm"})
    EXPECT_TRUE(std::filesystem::exists(study_.output() / name)) << name;
  EXPECT_EQ(run_command({"report", study_.path().string()}).exit_status, 1);  // no result
}

TEST_F(RegisterCommandTest, AReviewedResultIsWrittenOnlyOnRequestAndMarked) {
  // This preset leaves a check out, and asks for review because of that.
  EXPECT_EQ(register_study(study_, {"--preset", "fast"}).exit_status, 3);
  EXPECT_FALSE(std::filesystem::exists(study_.output() / "spatial_registration.dcm"));
  EXPECT_EQ(register_study(study_, {"--preset", "fast", "--write-reg-for-review", "--overwrite"}).exit_status, 3);
  const DicomFile file = DicomFile::read(study_.output() / "spatial_registration.dcm", DicomFile::Extent::kWhole);
  EXPECT_EQ(file.dataset().text(DCM_ContentLabel), "SETUP_REVIEW");
  EXPECT_EQ(file.dataset().text(DCM_ContentDescription), "NOT ACCEPTED: REVIEW");
}

TEST_F(RegisterCommandTest, AnotherPatientIsNeverAcceptedAndNeverWrittenWhereRejected) {
  // The X-rays of a head against the CT of a spine.
  SmallStudy other([] {
    PhantomOptions options = small_phantom();
    options.anatomy = PhantomOptions::Anatomy::kSpine;
    return options;
  }());
  const CommandOutcome outcome =
      register_study(study_, {"--ct", (other.path() / "CT").string(), "--allow", "patient-mismatch=test", "--allow",
                              "for-mismatch=test", "--preset", "fast", "--write-reg-for-review"});
  ASSERT_THAT(outcome.exit_status, testing::AnyOf(3, 4)) << outcome.err;
  EXPECT_THAT(result()["reasons"].dump(), HasSubstr("gradient correlation"));
  EXPECT_EQ(std::filesystem::exists(study_.output() / "spatial_registration.dcm"), outcome.exit_status == 3);
  EXPECT_EQ(result()["couch_shift"].is_null(), outcome.exit_status == 4);
}

TEST_F(RegisterCommandTest, AllowedFindingsAreInTheResult) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_AcquisitionTime, "104500"); });
  EXPECT_EQ(register_study(study_, {"--allow", "time-span=phantom does not move"}).exit_status, 0);
  EXPECT_THAT(result()["overrides"][0].get<std::string>(), HasSubstr("(allowed by time-span: phantom does not move)"));
}

TEST_F(RegisterCommandTest, TheSameXrayTwiceIsOneView) {
  std::filesystem::copy(study_.image(0), study_.path() / "RTIMAGE" / "again.dcm");
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(result()["views"].size(), 2U);
  EXPECT_THAT(outcome.err, HasSubstr("left aside: "));
  EXPECT_THAT(result()["left_aside"].dump(), HasSubstr("the same X-ray as"));
}

TEST_F(RegisterCommandTest, AViewWithoutATimeIsWarnedOfAndDoesNotHideTheOthers) {
  edit(study_.image(0), [](DicomItem d) {
    d.erase(DCM_AcquisitionTime);
    d.erase(DCM_ContentTime);
  });
  register_study(study_);
  EXPECT_THAT(result()["warnings"].dump(), HasSubstr("KV_G000: AcquisitionTime (0008,0032) is missing"));
}

// Whether the couch moved in between nobody knows without its read-outs, which the phantom's X-rays do not have.
TEST_F(RegisterCommandTest, ViewsFarApartWithoutTableReadOutsNeedAReview) {
  const auto take_second_at = [&](const char* time) {
    edit(study_.image(1), [&](DicomItem d) { d.put(DCM_AcquisitionTime, time); });
  };
  const auto reasons = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"--overwrite"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    register_study(study_, arguments);
    return fmt::format("{} {}", result()["verdict"].get<std::string>(), result()["reasons"].dump());
  };
  take_second_at("101659");
  EXPECT_EQ(reasons({}), "accepted []");
  take_second_at("101710");
  EXPECT_EQ(reasons({}),
            "review [\"KV_G090 was taken 130 s after KV_G000, more than 120 s: without measured table positions in all "
            "views it is not known whether the table moved (--allow time-span=REASON)\"]");
  EXPECT_EQ(reasons({"--allow", "time-span=the couch stood still"}), "accepted []");
  EXPECT_THAT(result()["overrides"].dump(), HasSubstr("130 s after KV_G000"));
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

TEST_F(RegisterCommandTest, AViewTakenTwiceNeedsAReviewWhereTheTableIsUnknown) {
  const std::filesystem::path again = study_.path() / "RTIMAGE" / "AGAIN.dcm";
  std::filesystem::copy_file(study_.image(1), again);
  edit(again, [](DicomItem d) {
    d.put(DCM_SOPInstanceUID, "1.2.3.4");
    d.put(DCM_AcquisitionTime, "101530");
  });
  EXPECT_EQ(register_study(study_).exit_status, 3);
  EXPECT_THAT(result()["reasons"].dump(), HasSubstr("AGAIN.dcm show the same view"));
}

// What nobody knows is not taken for granted.
TEST_F(RegisterCommandTest, ViewsThatMayBeOfTwoSetupsNeedAReview) {
  const auto reasons = [&](const std::function<void(DicomItem)>& change) {
    const SmallStudy study;
    edit(study.image(1), change);
    register_study(study);
    return nlohmann::json::parse(std::ifstream(study.output() / "result.json"))["reasons"].dump();
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
TEST_F(RegisterCommandTest, ATableThatStandsWhereItStoodDoesNotReplaceTheTimes) {
  for (const int n : {0, 1})
    edit(study_.image(n), [&](DicomItem d) {
      d.put(DCM_TableTopLateralPosition, 10.0);
      d.put(DCM_TableTopLongitudinalPosition, 812.0);
      d.put(DCM_TableTopVerticalPosition, -150.0);
      d.put(DCM_AcquisitionTime, n == 0 ? "1015" : "1601");  // hours apart, without seconds
    });
  EXPECT_EQ(register_study(study_).exit_status, 3);
  EXPECT_THAT(result()["reasons"].dump(), HasSubstr("so it is not known whether the views show one setup"));
}

TEST_F(RegisterCommandTest, ViewsOfTwoFractionsNeedAReview) {
  for (const int n : {0, 1}) edit(study_.image(n), [&](DicomItem d) { d.put(DCM_FractionNumber, 6.0 + n); });
  EXPECT_EQ(register_study(study_).exit_status, 3);
  EXPECT_THAT(result()["reasons"].dump(), HasSubstr("KV_G090 is of fraction 7, KV_G000 of 6"));
}

// The isocenter, in the frame of the CT, tells of a second plan or of a move that no read-out tells.
TEST_F(RegisterCommandTest, ViewsOfTwoIsocentersNeedAReview) {
  const auto reasons = [](double apart_mm) {
    const SmallStudy study;
    for (const int n : {0, 1})
      edit(study.image(n), [&](DicomItem d) {
        const std::array isocenter_mm = {0.0, 0.0, n * apart_mm};
        d.put(DCM_IsocenterPosition, isocenter_mm);
      });
    register_study(study);
    return nlohmann::json::parse(std::ifstream(study.output() / "result.json"))["reasons"].dump();
  };
  EXPECT_THAT(reasons(0.1), testing::Not(HasSubstr("different isocenters")));
  EXPECT_THAT(reasons(2.0), HasSubstr("KV_G090 and KV_G000 have different isocenters"));
}

// Programs that know no table position write zeros or huge numbers, or the planned position: whether the table moved in
// the three minutes is not known.
TEST_F(RegisterCommandTest, PlaceholdersAreNoTablePosition) {
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
    return nlohmann::json::parse(std::ifstream(study.output() / "result.json"))["reasons"].dump();
  };
  EXPECT_THAT(reasons(0.0), HasSubstr("without measured table positions in all views"));
  EXPECT_THAT(reasons(99999.0), HasSubstr("without measured table positions in all views"));
  EXPECT_THAT(reasons(812.0), testing::Not(HasSubstr("table positions")));
  EXPECT_THAT(reasons(812.0, "PLAN"), HasSubstr("without measured table positions in all views"));
}

TEST_F(RegisterCommandTest, ASwitchThatContradictsAReadOutNeedsAReview) {
  const CommandOutcome outcome = register_study(study_, {"--couch-pitch", "1"});
  EXPECT_EQ(outcome.exit_status, 3) << outcome.err;
  EXPECT_THAT(result()["reasons"].dump(), HasSubstr("--couch-pitch 1 contradicts KV_G000"));
}

TEST_F(RegisterCommandTest, AnAngleTypedInAgainstTheMeasuredOneNeedsAReviewUnlessAllowed) {
  const std::vector<std::string> typed = {"--gantry-angle", "KV_G000=2"};
  EXPECT_EQ(register_study(study_, typed).exit_status, 3);
  EXPECT_THAT(result()["reasons"].dump(),
              HasSubstr("--gantry-angle KV_G000=2 contradicts KV_G000: GantryAngle (300A,011E) is 0 (--allow "
                        "planned-geometry=REASON)"));
  register_study(study_, {"--gantry-angle", "KV_G000=2", "--allow", "planned-geometry=a test", "--overwrite"});
  EXPECT_THAT(result()["reasons"].dump(), testing::Not(HasSubstr("contradicts")));
  EXPECT_THAT(result()["overrides"].dump(), HasSubstr("(allowed by planned-geometry: a test)"));
}

TEST_F(RegisterCommandTest, AnIsocenterThatIsNotThePlansNeedsAReview) {
  EXPECT_EQ(register_study(study_, {"--isocenter", "-2.5,38,-410"}).exit_status, 3);
  EXPECT_THAT(result()["reasons"].dump(), HasSubstr("--isocenter -2.5,38,-410 contradicts the plan"));
  EXPECT_EQ(register_study(study_, {"--isocenter", "-12.5,38,-410.2", "--overwrite"}).exit_status, 0);
}

TEST_F(RegisterCommandTest, ABeamThatTreatsElsewhereThanItWasImagedNeedsAReview) {
  edit(study_.plan(), [](DicomItem plan) {
    DicomItem beam = plan.append_item(DCM_BeamSequence);
    beam.put(DCM_BeamNumber, 9.0);
    beam.put(DCM_TreatmentDeliveryType, "TREATMENT");
    beam.append_item(DCM_ControlPointSequence).put(DCM_IsocenterPosition, "-2.5\\38\\-410");
  });
  EXPECT_EQ(register_study(study_).exit_status, 3);
  EXPECT_THAT(result()["reasons"].dump(),
              HasSubstr("no beam that treats has it: that of beam 9 is (-2.5, 38, -410) mm"));
}

TEST_F(RegisterCommandTest, ATruthAboutAnotherSetupIsRefusedBeforeAnythingIsWritten) {
  std::ofstream(study_.truth(), std::ios::trunc)
      << R"({"patient_position": "FFS", "setup_error_room": {"translation_mm": [0, 0, 0],
             "rotation_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}})";
  const CommandOutcome outcome = register_study(study_, {"--truth", study_.truth().string()});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("its patient position is FFS, and that of the study HFS"));
  EXPECT_FALSE(std::filesystem::exists(study_.output()));
}

TEST_F(RegisterCommandTest, AnXrayWithTheUidOfThePlanIsRefused) {
  std::string uid;
  edit(study_.plan(), [&](DicomItem plan) { uid = plan.required_uid(DCM_SOPInstanceUID); });
  edit(study_.image(0), [&](DicomItem d) { d.put(DCM_SOPInstanceUID, uid); });
  EXPECT_THAT(register_study(study_).err, HasSubstr("KV_G000.dcm: has the SOPInstanceUID (0008,0018) of"));
}

TEST_F(RegisterCommandTest, ContradictionsThatDecideNothingAreWarnedOf) {
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

TEST_F(RegisterCommandTest, ViewsAreInTheOrderOfTheirLabels) {
  const CommandOutcome outcome =
      register_study(study_, {"--image", study_.image(1).string(), "--image", study_.image(0).string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_EQ(result()["views"][0]["label"], "KV_G000");
  EXPECT_EQ(result()["views"][1]["label"], "KV_G090");
}

TEST_F(RegisterCommandTest, AnglesThatNoCouchHasAreRefused) {
  for (const auto& [flag, angle] :
       {std::pair("--couch-angle", "400"), std::pair("--couch-pitch", "90"), std::pair("--couch-roll", "-60")}) {
    const CommandOutcome outcome = register_study(study_, {flag, angle});
    EXPECT_EQ(outcome.exit_status, 2) << flag;
    EXPECT_THAT(outcome.err, HasSubstr(fmt::format("{}: {}, expected degrees from -", flag, angle)));
  }
  EXPECT_EQ(register_study(study_, {"--couch-pitch", "359.95"}).exit_status, 0);
}

// A switch supplies what is missing; a table that was seen to turn is refused whatever a switch says.
TEST_F(RegisterCommandTest, ASwitchHidesNoMoveOfTheTable) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_PatientSupportAngle, 3.0); });
  const CommandOutcome outcome = register_study(study_, {"--couch-angle", "0"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("the table turned by 3.0 degrees"));
}

TEST_F(RegisterCommandTest, LabelsCannotForgeLines) {
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_RTImageLabel, "A\nVERDICT"); });
  edit(study_.image(1), [](DicomItem d) {
    d.put(DCM_RTImageLabel, "B\nerror: forged");
    d.erase(DCM_AcquisitionTime);
    d.erase(DCM_ContentTime);
  });
  const CommandOutcome outcome = register_study(study_);
  EXPECT_THAT(outcome.err, testing::Not(HasSubstr("\nerror: forged")));
  EXPECT_THAT(outcome.out, HasSubstr("A VERDICT"));
}

TEST_F(RegisterCommandTest, LogsHoldNoPatientName) {
  const CommandOutcome outcome = register_study(study_);
  EXPECT_THAT(outcome.err, testing::Not(HasSubstr("Phantom^Digital")));
  EXPECT_THAT(outcome.err, testing::Not(HasSubstr("PHANTOM1")));
}

TEST_F(RegisterCommandTest, DrrAtTheFoundPoseLooksLikeTheXray) {
  EXPECT_EQ(run_command({"drr", study_.path().string(), "-o", study_.output().string(), "--setup-error",
                         study_.truth().string()})
                .exit_status,
            0);
  for (const char* name : {"drr1.png", "drr1.mha", "drr2.png", "drr2.mha"})
    EXPECT_TRUE(std::filesystem::exists(study_.output() / name)) << name;
  std::ifstream file(study_.output() / "drr1.mha", std::ios::binary);
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, "ObjectType = Image");
}

TEST_F(RegisterCommandTest, InspectSaysWhatIsThereAndWhatIsMissing) {
  edit(study_.image(0), [](DicomItem d) {
    d.erase(DCM_RTImageSID);
    d.put(DCM_RTImagePosition, "");
    d.erase(DCM_TableTopPitchAngle);
  });
  std::ofstream(study_.path() / "notes.txt") << "not DICOM";
  const auto square = rectangle({0, 40, -400}, 20, 20);
  draw(study_, {{"Spine", {square, square}}, {"Marker", {{{1, 2, 3}}}, "POINT"}});
  const CommandOutcome outcome = run_command({"inspect", study_.path().string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("RT Plan \"SETUP\""));
  EXPECT_THAT(outcome.out, HasSubstr("isocenter (-12.5, 38, -410) mm, HFS, couch 0 deg"));
  EXPECT_THAT(outcome.out, HasSubstr("48 x 58 x 36, spacing (4, 4, 6) mm"));
  EXPECT_THAT(outcome.out, HasSubstr("  MISSING                  RTImagePosition (3002,0012); supplied by "
                                     "--rt-image-position X,Y or --assume-centered\n"
                                     "  MISSING                  RTImageSID (3002,0026); supplied by --sid MM\n"));
  EXPECT_THAT(outcome.out, HasSubstr("  couch pitch              missing, taken as 0 without --couch-pitch DEG\n"
                                     "  couch roll               0 deg\n"));
  EXPECT_THAT(outcome.out, HasSubstr("  source, IEC fixed        (1000.00, 0.00, 0.00) mm\n"));
  EXPECT_THAT(outcome.out,
              HasSubstr("RT Structure Set \"DRAWN\", " + study_.structures().string() +
                        "\n"
                        "  structure 1 \"Spine\"      ORGAN, 2 closed contours\n"
                        "  structure 2 \"Marker\"     ORGAN, 0 closed contours, 1 that encloses nothing\n"));
  EXPECT_THAT(outcome.out, HasSubstr("notes.txt: not a DICOM file"));
}

TEST_F(RegisterCommandTest, InspectSaysWhyStructuresAreRefused) {
  draw(study_, {{"Spine", {rectangle({0, 40, -400}, 20, 20)}}});
  edit(study_.structures(), [](DicomItem d) { d.erase(DCM_StructureSetROISequence); });
  const CommandOutcome outcome = run_command({"inspect", study_.structures().string()});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.out, HasSubstr("  REFUSED                  " + study_.structures().string() +
                                     ": ROIContourSequence (3006,0039) item 1: ReferencedROINumber (3006,0084) is 1"));
}

TEST_F(RegisterCommandTest, FramesOfOneFileAreViewsAsFilesOfTheirOwn) {
  ASSERT_EQ(register_study(study_).exit_status, 0);
  const nlohmann::json of_files = result();
  join_images(study_);
  const CommandOutcome outcome = register_study(study_, {"--overwrite", "--write-reg-for-review"});
  // The file does not say when its second frame was taken, and the phantom has no table read-outs.
  EXPECT_EQ(outcome.exit_status, 3) << outcome.err;
  const nlohmann::json of_frames = result();
  EXPECT_EQ(of_frames["setup_error"], of_files["setup_error"]);
  EXPECT_EQ(of_frames["views"][1]["frame"], 2);
  const CommandOutcome checked = run_shell("dciodvfy -new " + (study_.output() / "spatial_registration.dcm").string());
  EXPECT_THAT(checked.out, testing::Not(HasSubstr("Error"))) << checked.out;
}

TEST_F(RegisterCommandTest, NamesInOtherCharacterSetsAreKept) {
  const auto rename = [](const std::filesystem::path& path) {
    edit(path, [](DicomItem d) {
      d.put(DCM_SpecificCharacterSet, "ISO_IR 100");
      d.put(DCM_PatientName, "M\xFCller^J\xF6rg");
    });
  };
  for (const auto& entry : std::filesystem::recursive_directory_iterator(study_.path()))
    if (entry.path().extension() == ".dcm") rename(entry.path());
  const CommandOutcome outcome = register_study(study_, {"--write-reg-for-review"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("Müller Jörg"));
  const CommandOutcome dumped =
      run_shell("dcmdump +P 0008,0005 +P 0010,0010 " + (study_.output() / "spatial_registration.dcm").string());
  EXPECT_THAT(dumped.out, HasSubstr("[ISO_IR 192]"));
  EXPECT_THAT(dumped.out, HasSubstr("[Müller^Jörg]"));
}

// Old exports begin with the dataset: no 128 bytes, no "DICM", no transfer syntax.
TEST_F(RegisterCommandTest, FilesWithoutAHeaderAreReadToo) {
  ASSERT_EQ(register_study(study_).exit_status, 0);
  const nlohmann::json expected = result()["setup_error"];
  for (const auto& entry : std::filesystem::recursive_directory_iterator(study_.path()))
    if (entry.path().extension() == ".dcm") {
      const std::string file = entry.path().string();
      const CommandOutcome converted =
          run_shell(fmt::format("dcmconv -F +ti '{}' '{}.new' && mv '{}.new' '{}'", file, file, file, file));
      ASSERT_EQ(converted.exit_status, 0) << converted.out;
    }
  const CommandOutcome again = register_study(study_, {"--overwrite"});
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(result()["setup_error"], expected);
}

}  // namespace
}  // namespace isoshift::register_command_test
