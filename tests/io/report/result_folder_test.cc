// The folder of a result: written, read back, and seen by other programs.

#include "io/report/result_folder.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "geometry/rotation.h"
#include "io/report/formats.h"
#include "tests/support/command.h"
#include "tests/support/oblique_report.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::result_folder_test {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

std::string text_of(const SetupResult& report) { return text_report(report_page(report)); }

class ResultFolderTest : public testing::Test {
 protected:
  ResultFolderTest() {
    report_.site = small_couch();
    report_.uncertainty = uncertainty_of_independent_axes({0.1, 0.2, 0.3}, {0.001, 0.002, 0.003});
    report_.stages = {{.name = "fine",
                       .similarity = "ncc",
                       .optimizer = "bobyqa",
                       .parameters = {{"pixel_mm", 1.0}},
                       .evaluations = 3,
                       .termination = "converged",
                       .best = {0.1, 0.4, 0.9}}};
    report_.points = {{"centroid of PTV", {1, 2, 3}}};
    report_.table_position_mm = Eigen::Vector3d(1, 2, 3);
    report_.spatial_registration_uid = "2.25.1";
    report_.views.front().match.consistency.parts = {{.center_px = {20, 20}, .width_px = 10, .disagrees = true}};
    write_result(report_, folder_.path());
  }
  TemporaryFolder folder_;
  SetupResult report_ = oblique_report(Verdict::kAccepted);
};

TEST_F(ResultFolderTest, IsReadBackWhole) {
  const SetupResult read = read_result(folder_.path());
  EXPECT_EQ(json_report(read), json_report(report_));
  EXPECT_EQ(read.views[0].picture.drr_found.pixels, report_.views[0].picture.drr_found.pixels);
  EXPECT_EQ(csv_report(read), csv_report(report_));
  EXPECT_EQ(text_of(read), text_of(report_));
}

TEST_F(ResultFolderTest, WhereItBeganIsReadBackAndSaidFirst) {
  EXPECT_THAT(text_of(report_), Not(HasSubstr("SEARCHED")));
  Eigen::Isometry3d set = Eigen::Isometry3d::Identity();
  set.translation() = Eigen::Vector3d(1.5, -2.0, 0.25);
  set.linear() = rotation_z(0.1);
  report_.start = Start{.setup_error = set, .file = "pose.json", .sha256 = "ab", .set_by = "jdoe"};
  EXPECT_THAT(text_of(report_), HasSubstr("searched from a start set by hand by jdoe"));
  report_.is_searched = false;
  report_.stages.clear();
  EXPECT_THAT(text_of(report_), HasSubstr("set by hand by jdoe, NOT SEARCHED"));
  const SetupResult read = report_from_json(json_report(report_), "result.json");
  EXPECT_EQ(json_report(read), json_report(report_));
  EXPECT_EQ(text_of(read), text_of(report_));
  EXPECT_TRUE(read.start->setup_error.isApprox(set, 1e-12));
  report_.start.reset();
  EXPECT_THAT(text_of(report_), HasSubstr("as planned, NOT SEARCHED"));
}

TEST_F(ResultFolderTest, WhatBodiesDidIsReadBack) {
  SetupResult bent = bent_report(Verdict::kAccepted);
  bent.target_match = {0.91, 0.87, 0.85, 0.97};
  const SetupResult read = report_from_json(json_report(bent), "result.json");
  EXPECT_EQ(json_report(read), json_report(bent));
  ASSERT_EQ(read.bodies.size(), bent.bodies.size());
  EXPECT_EQ(read.target_deformation_mm, bent.target_deformation_mm);
  EXPECT_EQ(read.target_image_share, bent.target_image_share);
  ASSERT_EQ(read.structures.size(), 1U);
  EXPECT_EQ(read.target_match.of_most_within_40_mm, 0.91);
  EXPECT_EQ(read.target_match.of_most_within_20_mm, 0.87);
  EXPECT_EQ(read.target_match.of_all, 0.85);
  EXPECT_EQ(read.target_match.of_parts, 0.97);
  EXPECT_EQ(read.structures[0].name, bent.structures[0].name);
  EXPECT_EQ(read.structures[0].most_mm, bent.structures[0].most_mm);
  EXPECT_EQ(read.structures[0].displacement_mm, bent.structures[0].displacement_mm);
  for (std::size_t n = 0; n < bent.bodies.size(); ++n) {
    EXPECT_EQ(read.bodies[n].name, bent.bodies[n].name);
    EXPECT_EQ(read.bodies[n].displacement_mm, bent.bodies[n].displacement_mm);
    EXPECT_LT((read.bodies[n].rotation_rad - bent.bodies[n].rotation_rad).norm(), 1e-12);
    EXPECT_EQ(read.bodies[n].is_determined(), bent.bodies[n].is_determined());
  }
}

// The sigma of a point far from the isocenter depends on how errors of translation and rotation go together.
TEST_F(ResultFolderTest, TheCovarianceIsReadBack) {
  SetupResult report = bent_report(Verdict::kAccepted);
  Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Identity() * 0.1;
  root.bottomRows<3>() *= 0.01;
  root(0, 4) = -0.05;
  report.uncertainty = Uncertainty{.covariance = root * root.transpose()};
  const SetupResult read = report_from_json(json_report(report), "result.json");
  EXPECT_EQ(read.uncertainty->covariance, report.uncertainty->covariance);
}

// Of a finding everything is read back, and its words are those that were written.
TEST_F(ResultFolderTest, FindingsAreReadBack) {
  SetupResult report = bent_report(Verdict::kAccepted);
  report.findings = {
      {.check = Check::kPullsThePose,
       .view = "KV_45",
       .measures = {{.value = 1.4, .limit = 1.0, .unit = "mm"}, {.value = 0.1, .limit = 1.0, .unit = "deg"}}},
      {.check = Check::kMatch,
       .consequence = Verdict::kRejected,
       .measures = {{.value = std::numeric_limits<double>::quiet_NaN(), .limit = 0.5}}},
      {.check = Check::kFiles, .words = "the CT lacks slices"}};
  const auto json = nlohmann::json::parse(json_report(report));
  EXPECT_EQ(json["findings"][0]["check"], "pulls_the_pose");
  EXPECT_TRUE(json["findings"][1]["measures"][0]["value"].is_null());
  const SetupResult read = report_from_json(json.dump(), "result.json");
  EXPECT_EQ(read.verdict(), Verdict::kRejected);
  EXPECT_EQ(read.reasons(), report.reasons());
  EXPECT_EQ(nlohmann::json::parse(json_report(read))["findings"], json["findings"]);
}

// What is not a number is written as null; the body is then not determined.
TEST_F(ResultFolderTest, ABodyWhoseSigmaIsNoNumberIsNotDetermined) {
  SetupResult bent = bent_report(Verdict::kReview);
  bent.bodies[0].sigma_mm.z() = std::numeric_limits<double>::quiet_NaN();
  const auto json = nlohmann::json::parse(json_report(bent));
  EXPECT_TRUE(json["bodies"][0]["sigma_mm"][2].is_null());
  EXPECT_EQ(json["bodies"][0]["is_determined"], false);
  EXPECT_FALSE(report_from_json(json.dump(), "result.json").bodies[0].is_determined());
}

// Whatever number of the shift is edited, the others still say what was found.
TEST_F(ResultFolderTest, AShiftThatWasChangedByHandIsRefused) {
  const auto json = nlohmann::json::parse(json_report(bent_report(Verdict::kAccepted)));
  for (const char* place :
       {"/setup_error/translation_mm/0", "/setup_error/known_translation_mm/1", "/setup_error/rotation_deg/rz",
        "/couch_shift/vertical_mm", "/couch_shift/pitch_deg", "/couch_target_deg/yaw"}) {
    auto changed = json;
    auto& number = changed[nlohmann::json::json_pointer(place)];
    number = number.get<double>() + 0.01;
    EXPECT_THAT([&] { report_from_json(changed.dump(), "result.json"); },
                ThrowsMessage<Error>(HasSubstr("the file was changed after it was made")))
        << place;
  }
  auto turned = json, scaled = json;
  turned["setup_error"]["rotation_matrix"] = {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}};
  EXPECT_THAT([&] { report_from_json(turned.dump(), "result.json"); },
              ThrowsMessage<Error>(HasSubstr("the file was changed after it was made")));
  scaled["setup_error"]["rotation_matrix"][0] = {2, 0, 0};
  EXPECT_THAT([&] { report_from_json(scaled.dump(), "result.json"); },
              ThrowsMessage<Error>(HasSubstr("result.json: setup_error: rotation_matrix is no rotation")));
  auto judged = nlohmann::json::parse(json_report(bent_report(Verdict::kReview))), found = judged;
  judged["verdict"] = "fine";
  EXPECT_THAT([&] { report_from_json(judged.dump(), "result.json"); },
              ThrowsMessage<Error>(HasSubstr("result.json: verdict is \"fine\", but findings make it \"review\"")));
  found["findings"][0]["consequence"] = "accepted";
  EXPECT_THAT([&] { report_from_json(found.dump(), "result.json"); },
              ThrowsMessage<Error>(HasSubstr("findings: consequence is \"accepted\", expected review or rejected")));
}

// What is said twice is compared: both fields are named.
TEST_F(ResultFolderTest, AResultThatContradictsItselfIsRefused) {
  SetupResult report = bent_report(Verdict::kAccepted);
  report.uncertainty = uncertainty_of_independent_axes({0.1, 0.2, 0.3}, {0.001, 0.002, 0.003});
  report.site = small_couch();
  report.stages = {{.name = "fine", .parameters = {{"pixel_mm", 1.0}}, .evaluations = 3}};
  SetupResult::View& view = report.views.front();
  view.gantry_deg = 0.0;
  view.source_room_mm = {0, 0, 1000};
  view.pixel_from_room.emplace() << 0.5, 0, -0.06, 60, 0, -0.5, -0.06, 60, 0, 0, -0.001, 1;
  view.pixel_from_room.value() *= 2.0 / 3.0;
  view.pixel_mm = 2.0;
  view.sid_mm = 1500.0;
  report.views.push_back(view);
  report.views[1].sop_instance_uid = "1.2.3.5";
  report.alternatives = {{.description = "KV_45 mirrored", .similarity = 0.6, .as_is = 0.9}};
  const auto json = nlohmann::json::parse(json_report(report));
  ASSERT_NO_THROW(report_from_json(json.dump(), "result.json"));
  const std::vector<std::tuple<const char*, nlohmann::json, const char*, const char*>> edits = {
      {"/reasons", {"the views disagree"}, "reasons holds 1", "findings holds 0"},
      {"/verdict", "review", "verdict", "findings"},
      {"/searched", false, "searched", "stages"},
      {"/views/0/pixel_mm", 0.5, "views/0/pixel_mm", "views/0/pixel_from_room"},
      {"/views/0/sid_mm", 1800.0, "views/0/sid_mm", "views/0/pixel_from_room"},
      {"/views/0/similarity_final", 7, "views/0/similarity_final is 7", "between -1 and 1"},
      {"/alternatives/0/similarity", 7, "alternatives/0/similarity", "between -1 and 1"},
      {"/verdict", "rejected", "verdict", "findings"},
      {"/uncertainty/translation_mm/1", 2.0, "uncertainty/translation_mm/1", "uncertainty/covariance"},
      {"/uncertainty/covariance/1/1", 0.0004, "target/sigma_mm", "uncertainty/covariance"},
      {"/uncertainty/covariance/1/0", 0.1, "uncertainty/covariance", "not symmetric"},
      {"/uncertainty/rotation_deg", nullptr, "uncertainty/rotation_deg", "uncertainty/covariance"},
      {"/target/displacement_mm/2", 3.0, "target/displacement_mm/2", "setup_error and target/center_room_mm"},
      {"/target/center_room_mm/1", 60.0, "couch_applied", "target/center_room_mm"},
      {"/views/0/gantry_deg", 45.0, "views/0/gantry_deg is 45", "views/0/source_room_mm"},
      {"/views/0/source_room_mm/0", 400.0, "views/0/source_room_mm", "views/0/pixel_from_room"},
      {"/views/0/pixel_from_room/0/3", 300.0, "views/0/source_room_mm", "views/0/pixel_from_room"},
      {"/views/0/sop_instance_uid", "1.2.99", "references/images/0", "views/sop_instance_uid"},
      {"/action", "no shift needed", "action", "site/action_level"},
      {"/site/action_level/translation_mm", 50.0, "action", "site/action_level"},
      {"/couch_applied/lateral_mm", 1.0, "couch_applied/lateral_mm", "site"},
      {"/left_over/0/mm/0", 1.0, "left_over/0/mm/0", "setup_error"},
      {"/evaluations", 7, "evaluations", "stages"},
      {"/bodies/0/is_determined", false, "bodies/0/is_determined", "bodies/sigma_mm"}};
  for (const auto& [place, value, field, other] : edits) {
    auto changed = json;
    changed[nlohmann::json::json_pointer(place)] = value;
    ASSERT_NE(changed, json) << place;
    EXPECT_THAT([&] { report_from_json(changed.dump(), "result.json"); },
                ThrowsMessage<Error>(testing::AllOf(HasSubstr("result.json: "), HasSubstr(field), HasSubstr(other),
                                                    HasSubstr("the file was changed after it was made"))))
        << place;
  }
}

TEST_F(ResultFolderTest, OneXrayIsNoTwoViewsAndAReasonSaysSomething) {
  const auto error_of = [](const SetupResult& report) -> std::string {
    try {
      report_from_json(json_report(report), "result.json");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  SetupResult report = oblique_report(Verdict::kReview);
  report.views.push_back(report.views.front());
  EXPECT_THAT(error_of(report), HasSubstr("views/1/sop_instance_uid is that of an earlier view"));
  report.views[1].frame = 2;
  EXPECT_EQ(error_of(report), "");
  report.findings.front().words.clear();
  EXPECT_THAT(error_of(report), HasSubstr("findings holds one that says nothing"));
}

TEST_F(ResultFolderTest, ThePdfIsADicomObjectToo) {
  const CommandOutcome checked = run_shell("dciodvfy -new " + (folder_ / "report.dcm").string());
  EXPECT_THAT(checked.out, Not(HasSubstr("Error"))) << checked.out;
  const CommandOutcome read = run_shell(fmt::format(
      "/usr/bin/python3 -c \"import pydicom, sys; d = pydicom.dcmread('{0}/report.dcm'); "
      "sys.exit(0 if d.EncapsulatedDocument[:d.EncapsulatedDocumentLength] == open('{0}/report.pdf', 'rb').read() "
      "and "
      "[s.ReferencedSOPInstanceUID for s in d.SourceInstanceSequence] == ['1.2.9', '1.2.3.4', '2.25.1'] and "
      "d.StudyInstanceUID == '1.2.3' and d.PatientID == 'ID-1' and d.BurnedInAnnotation == 'YES' else 1)\"",
      folder_.path().string()));
  EXPECT_EQ(read.exit_status, 0) << read.out;
}

TEST_F(ResultFolderTest, WhatIsMissingOrSpoiledIsNamed) {
  std::filesystem::remove(folder_ / "view1_found.png");
  EXPECT_THROW(
      {
        try {
          read_result(folder_.path());
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("view1_found.png: cannot be read as a PNG"));
          throw;
        }
      },
      Error);
  EXPECT_THROW(report_from_json("{\"schema\": 2}", "result.json"), Error);
  EXPECT_THROW(report_from_json("no json", "result.json"), Error);
  EXPECT_THROW(read_result(folder_ / "nowhere"), Error);
}

// Opened, slid and seen in a browser.
TEST_F(ResultFolderTest, ThePageWorksInABrowser) {
  const CommandOutcome outcome =
      run_shell(fmt::format("/usr/bin/python3 {}/tests/io/report/html_report_in_browser.py {}", ISOSHIFT_SOURCE_DIR,
                            (folder_ / "report.html").string()));
  EXPECT_EQ(outcome.exit_status, 0) << outcome.out;
}

}  // namespace
}  // namespace isoshift::result_folder_test
