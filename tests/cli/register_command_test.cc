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
  EXPECT_EQ(nlohmann::json::parse(outcome.out), result_of(study_));
}

TEST_F(RegisterCommandTest, OneViewIsReviewWithoutDepthAndWithoutRegistrationObject) {
  const CommandOutcome outcome =
      register_study(study_, {"--image", study_.image(0).string(), "--write-reg-for-review"});
  EXPECT_EQ(outcome.exit_status, 3);
  EXPECT_EQ(result_of(study_)["verdict"], "review");
  EXPECT_TRUE(result_of(study_)["setup_error"]["translation_mm"][2].is_null());  // gantry 0 looks along z
  EXPECT_FALSE(result_of(study_)["setup_error"]["translation_mm"][0].is_null());
  EXPECT_TRUE(result_of(study_)["couch_shift"]["vertical_mm"].is_null());
  EXPECT_FALSE(std::filesystem::exists(study_.output() / "spatial_registration.dcm"));
}

TEST_F(RegisterCommandTest, WhatNobodyMeasuredIsWrittenAsZeroOnlyOnRequest) {
  const CommandOutcome outcome = register_study(
      study_, {"--image", study_.image(0).string(), "--write-reg-for-review", "--accept-unobservable", "--json"});
  EXPECT_EQ(outcome.exit_status, 3);
  EXPECT_THAT(result_of(study_)["overrides"].dump(),
              HasSubstr("which was not measured, is taken as 0 by --accept-unobservable"));
  const std::string written = (study_.output() / "spatial_registration.dcm").string();
  const CommandOutcome checked = run_command({"check", written, "--plan", study_.plan().string(), "--json"});
  const auto shift = nlohmann::json::parse(checked.out)["registrations"][0]["couch_shift"];
  EXPECT_NEAR(shift["vertical_mm"], 0.0, 1e-6);
  EXPECT_NEAR(shift["lateral_mm"], result_of(study_)["couch_shift"]["lateral_mm"], 1e-6);
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
  EXPECT_EQ(result_of(study_)["searched"], false);
  EXPECT_EQ(result_of(study_)["start"]["set_by"], "jdoe");
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
  EXPECT_TRUE(result_of(study_)["start"]["set_by"].is_null());
  EXPECT_EQ(result_of(study_)["start"]["file"], "before.json");
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
  // A person who edits the angles of a result or a truth, and not the matrix.
  const std::string edited = "[[1, 0, 0], [0, 1, 0], [0, 0, 1]], ";
  EXPECT_THAT(refusal("{" + about + edited + R"("rotation_deg_rx_ry_rz": [0, 0, 3]}})"),
              HasSubstr("its angles (0, 0, 3) degrees about x, y and z (R = Rz Rx Ry) contradict its rotation_matrix"));
  EXPECT_THAT(refusal("{" + about + edited + R"("rotation_deg": {"rx": -2, "ry": 0, "rz": 0}}})"),
              HasSubstr("which is 2.00 degrees away"));
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
  EXPECT_EQ(result_of(study_)["site"]["name"], "Linac 3");
  if (result_of(study_)["verdict"] != "rejected") {
    EXPECT_EQ(result_of(study_)["action"], "exceeds");
    EXPECT_EQ(result_of(study_)["left_over"].back()["at"], "centroid of TARGET");
    EXPECT_EQ(result_of(study_)["couch_applied"]["brings_right"], result_of(study_)["target"]["name"]);
  }
  EXPECT_FALSE(result_of(study_)["views"][0]["picture"]["structures"][0]["planned"].empty());
  EXPECT_EQ(register_study(study_, {"--overwrite", "--anatomy", "head"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--overwrite", "--site", site.string(), "--anatomy", "pelvis"}).exit_status, 2);
}

TEST_F(RegisterCommandTest, ReportMakesAllFormatsAgain) {
  register_study(study_);
  const auto before = result_of(study_);
  const std::string folder = study_.output().string();
  EXPECT_EQ(run_command({"report", folder}).exit_status, 1);  // nothing is overwritten unasked
  for (const char* name : {"report.txt", "report.pdf", "report.html", "report.csv", "report.dcm", "view1.png"})
    std::filesystem::remove(study_.output() / name);
  const CommandOutcome outcome = run_command({"report", folder, "--overwrite"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_EQ(result_of(study_), before);
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
  EXPECT_THAT(result_of(study_)["reasons"].dump(), HasSubstr("gradient correlation"));
  EXPECT_EQ(std::filesystem::exists(study_.output() / "spatial_registration.dcm"), outcome.exit_status == 3);
  EXPECT_EQ(result_of(study_)["couch_shift"].is_null(), outcome.exit_status == 4);
}

TEST_F(RegisterCommandTest, AllowedFindingsAreInTheResult) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_AcquisitionTime, "104500"); });
  EXPECT_EQ(register_study(study_, {"--allow", "time-span=phantom does not move"}).exit_status, 0);
  EXPECT_THAT(result_of(study_)["overrides"][0].get<std::string>(),
              HasSubstr("(allowed by time-span: phantom does not move)"));
}

TEST_F(RegisterCommandTest, ViewsAreInTheOrderOfTheirLabels) {
  const CommandOutcome outcome =
      register_study(study_, {"--image", study_.image(1).string(), "--image", study_.image(0).string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_EQ(result_of(study_)["views"][0]["label"], "KV_G000");
  EXPECT_EQ(result_of(study_)["views"][1]["label"], "KV_G090");
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
  const nlohmann::json of_files = result_of(study_);
  join_images(study_);
  const CommandOutcome outcome = register_study(study_, {"--overwrite", "--write-reg-for-review"});
  // The file does not say when its second frame was taken, and the phantom has no table read-outs.
  EXPECT_EQ(outcome.exit_status, 3) << outcome.err;
  const nlohmann::json of_frames = result_of(study_);
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
  const nlohmann::json expected = result_of(study_)["setup_error"];
  for (const auto& entry : std::filesystem::recursive_directory_iterator(study_.path()))
    if (entry.path().extension() == ".dcm") {
      const std::string file = entry.path().string();
      const CommandOutcome converted =
          run_shell(fmt::format("dcmconv -F +ti '{}' '{}.new' && mv '{}.new' '{}'", file, file, file, file));
      ASSERT_EQ(converted.exit_status, 0) << converted.out;
    }
  const CommandOutcome again = register_study(study_, {"--overwrite"});
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(result_of(study_)["setup_error"], expected);
}

}  // namespace
}  // namespace isoshift::register_command_test
