// isoshift qa audit-setup, from folders of results to the page.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/dicom/decode.h"
#include "tests/support/audited_archive.h"
#include "tests/support/findings.h"
#include "tests/support/small_study.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::audit_setup_command_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;
using testing::UnorderedElementsAre;
using Json = nlohmann::json;

std::string text_of(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

class AuditSetupCommandTest : public testing::Test {
 protected:
  fs::path results() const { return folder_ / "results"; }
  fs::path table() const { return folder_ / "used.csv"; }
  fs::path output() const { return folder_ / "audit"; }
  CommandOutcome run(std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), {"qa", "audit-setup", results().string()});
    return run_command(flags);
  }

  // An archive of one result, "a", and a folder with a copy of its registration object, "a.dcm".
  fs::path objects_of_a_result() const {
    const SmallStudy study;
    EXPECT_EQ(run_command({"register", study.path().string(), "-o", (results() / "a").string()}).exit_status, 0);
    const fs::path objects = folder_ / "used";
    fs::create_directories(objects);
    fs::copy_file(results() / "a" / "spatial_registration.dcm", objects / "a.dcm");
    return objects;
  }

  TemporaryFolder folder_;
};

// A year of 60 fractions with what is to be found in it: a drift, a swapped patient, two wrong signs; and one setup
// that isoshift rejected, because its X-rays are of another patient.
TEST_F(AuditSetupCommandTest, FindsDriftSwappedPatientAndWrongSignsAndNothingElse) {
  MadeArchive archive = made_archive(1, 2.5, true);
  const std::size_t other_patient = 2;
  archive.sessions[other_patient].result.findings =
      findings_for(Verdict::kRejected, "the target's surroundings match poorly");
  write_archive(archive, results(), table());
  const CommandOutcome outcome = run({"--used", table().string(), "-o", output().string(), "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  EXPECT_EQ(outcome.out, text_of(output() / "audit.json"));

  const Json audit = Json::parse(outcome.out);
  EXPECT_EQ(audit["counted"], 59);
  EXPECT_EQ(audit["compared"], 59);
  std::map<std::string, std::string> outliers;
  for (const Json& session : audit["sessions"])
    if (!session["outlier"].is_null()) outliers[session["session"]] = session["outlier"]["explanation"];
  ASSERT_EQ(outliers.size(), 3U) << audit.dump(2);
  EXPECT_THAT(
      outliers[MadeArchive::name_of(archive.swapped)],
      HasSubstr("swapped patient: the used shift is that of session " + MadeArchive::name_of(archive.swapped ^ 1)));
  for (const std::size_t n : {0U, 1U})
    EXPECT_THAT(outliers[MadeArchive::name_of(archive.signs[n])],
                HasSubstr(std::string("wrong sign of ") + kCouchAxes[archive.sign_axes[n]]));
  for (const auto& [axis, agreement] : audit["agreement"].items())
    EXPECT_EQ(agreement["drift"]["is_significant"], axis == "longitudinal_mm") << axis << agreement;
  EXPECT_NEAR(audit["agreement"]["longitudinal_mm"]["drift"]["slope_per_30_days"].get<double>(), 2.5 * 30.0 / 365.0,
              0.08);
  for (const auto& [component, drift] : audit["setup_error_drift"].items())
    EXPECT_EQ(drift["is_significant"], false) << component;

  const std::string page = text_of(output() / "audit.html"), csv = text_of(output() / "audit.csv");
  EXPECT_THAT(page, HasSubstr("href=\"../results/" + MadeArchive::name_of(archive.swapped) + "/report.html\""));
  EXPECT_THAT(page, HasSubstr("isoshift did not accept it (rejected): the target&#39;s surroundings match poorly"));
  EXPECT_TRUE(fs::exists(output() / "../results" / MadeArchive::name_of(archive.swapped) / "report.html"));
  EXPECT_THAT(page, Not(HasSubstr("http://"))) << "the page needs no network";
  EXPECT_EQ(std::ranges::count(csv, '\n'), 61);

  // The same in words; nothing is overwritten unless asked for.
  EXPECT_THAT(run({"--used", table().string()}).out, HasSubstr("drift of longitudinal: +0."));
  EXPECT_EQ(run({"--used", table().string(), "-o", output().string()}).exit_status, 1);
  EXPECT_EQ(run({"--used", table().string(), "-o", output().string(), "--overwrite"}).exit_status, 0);
}

// Also where the output is named from the working directory, and where names mean something in a URL.
TEST_F(AuditSetupCommandTest, LinksReportsWhateverTheyAreCalled) {
  write_archive(made_archive(1, 0.0, false), results(), table());
  fs::rename(results() / MadeArchive::name_of(3), results() / "day #3? 50% M\xC3\xBCller");
  const fs::path before = fs::current_path();
  fs::current_path(folder_.path());
  const CommandOutcome outcome = run_command({"qa", "audit-setup", "results", "-o", "audit"});
  fs::current_path(before);
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const std::string page = text_of(output() / "audit.html"), csv = text_of(output() / "audit.csv");
  EXPECT_THAT(page, HasSubstr("href=\"../results/day%20%233%3F%2050%25%20M%C3%BCller/report.html\""));
  EXPECT_THAT(page, HasSubstr("href=\"../results/" + MadeArchive::name_of(1) + "/report.html\""));
  EXPECT_THAT(csv, HasSubstr(",../results/" + MadeArchive::name_of(1) + "\n"));
}

// Registered by translations alone: every rotation is 0, and so is its scatter.
TEST_F(AuditSetupCommandTest, RotationsThatAreAllAlikeAreAudited) {
  MadeArchive archive = made_archive(1, 0.0, false);
  for (MadeSession& session : archive.sessions) {
    session.result.setup_error.linear().setIdentity();
    for (std::size_t axis = 3; axis < 6; ++axis) session.used[axis] = 0.0;
  }
  write_archive(archive, results(), table());
  const CommandOutcome outcome = run({"--used", table().string(), "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const Json audit = Json::parse(outcome.out);
  EXPECT_EQ(audit["agreement"]["yaw_deg"]["drift"]["is_significant"], false);
  EXPECT_EQ(audit["setup_error_drift"]["rx_deg"]["is_significant"], false) << audit["setup_error_drift"];
}

TEST_F(AuditSetupCommandTest, DescribesWhatIsoshiftFoundWithoutUsedShifts) {
  write_archive(made_archive(1, 0.0, false), results(), table());
  const CommandOutcome outcome = run();
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("sessions: 60, counted: 60 (patients: 10), 2026-01-01 to"));
  EXPECT_THAT(outcome.out, HasSubstr("0 compared with used shifts"));
  EXPECT_THAT(outcome.out, Not(HasSubstr("AGREEMENT")));
  EXPECT_THAT(outcome.out, HasSubstr("MARGINS"));
}

TEST_F(AuditSetupCommandTest, ResultsThatAreReadAreNotReplaced) {
  write_archive(made_archive(1, 0.0, false), results(), table());
  const fs::path one = fs::directory_iterator(results())->path();
  std::ofstream listing(one / ".isoshift");  // as register leaves it
  for (const auto& file : fs::directory_iterator(one)) listing << file.path().filename().string() << "\n";
  listing.close();
  const CommandOutcome outcome = run({"-o", one.string(), "--overwrite"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("which is read"));
  EXPECT_TRUE(fs::exists(one / "result.json"));
}

// Of two results of an X-ray the later counts, whatever the clocks of the programs showed and whatever else they hold.
TEST_F(AuditSetupCommandTest, OfResultsOfOneXrayTheLatestCounts) {
  MadeArchive archive = made_archive(1, 0.0, false);
  archive.sessions[0].result.made_on = "2026-03-01T10:16:02+0100";
  SetupResult& later = archive.sessions[1].result;
  later.views.push_back(archive.sessions[0].result.views.front());
  later.made_on = "2026-03-01T09:30:00+0000";
  // And of that one there is a later one, too.
  archive.sessions[2].result.views.push_back(later.views.front());
  archive.sessions[2].result.made_on = "2026-03-02T09:30:00+0000";
  write_archive(archive, results(), table());
  const Json audit = Json::parse(run({"--json"}).out);
  EXPECT_EQ(audit["counted"], 58);
  const auto left_out = [&](std::size_t session) {
    return std::ranges::find(audit["sessions"], MadeArchive::name_of(session),
                             [](const Json& one) { return one["session"].get<std::string>(); })
        ->at("left_out")
        .get<std::string>();
  };
  EXPECT_EQ(left_out(0), "its X-ray has a later result: " + MadeArchive::name_of(1));
  EXPECT_EQ(left_out(1), "X-rays of it have a later result: " + MadeArchive::name_of(2));
}

TEST_F(AuditSetupCommandTest, AResultThatCannotBeReadHasNoVerdict) {
  write_archive(made_archive(1, 0.0, false), results(), table());
  replace_text(results() / MadeArchive::name_of(0) / "result.json", "{}");
  const CommandOutcome outcome = run({"--json", "-o", output().string()});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const Json audit = Json::parse(outcome.out);
  EXPECT_EQ(audit["counted"], 59);
  EXPECT_EQ(audit["sessions"][0]["verdict"], "unreadable");
  EXPECT_THAT(text_of(output() / "audit.csv"), HasSubstr(MadeArchive::name_of(0) + ",,,,unreadable,no,no,"));
}

TEST_F(AuditSetupCommandTest, TheJsonSaysWhatItWasMadeFrom) {
  write_archive(made_archive(1, 0.0, false), results(), table());
  const Json audit = Json::parse(run({"--used", table().string(), "--json"}).out);
  EXPECT_EQ(audit["program"]["name"], "isoshift");
  EXPECT_EQ(audit["used_sha256"], sha256_of_file(table()));
  EXPECT_THAT(audit["made_on"], testing::StartsWith("20"));
  EXPECT_TRUE(audit["sessions"][0].contains("patient_id_issuer"));
}

// What register wrote is its own used shift; the object of another patient, or of no session, is of no use.
TEST_F(AuditSetupCommandTest, ReadsRegistrationObjectsByTheXraysTheyName) {
  const fs::path objects = objects_of_a_result();
  fs::remove(results() / "a" / "spatial_registration.dcm");
  const auto session = [&] {
    const CommandOutcome outcome = run({"--used", objects.string(), "--json"});
    EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
    return Json::parse(outcome.out)["sessions"][0];
  };
  Json found = session();
  for (const auto& [axis, difference] : found["difference"].items())
    EXPECT_NEAR(difference.is_null() ? 1.0 : difference.get<double>(), 0.0, 1e-4) << axis << found;

  edit(objects / "a.dcm", [](DicomItem d) { d.put(DCM_PatientID, "SOMEBODY"); });
  found = session();
  EXPECT_TRUE(found["used"]["lateral_mm"].is_null());
  EXPECT_THAT(found["not_compared"], HasSubstr("PatientID (0010,0020) differs"));
}

// An object that registers another frame, such as one written the wrong way around, has no shift of the session's.
TEST_F(AuditSetupCommandTest, AnObjectOfAnotherRegisteredFrameIsNotCompared) {
  const fs::path objects = objects_of_a_result();
  edit(objects / "a.dcm", [](DicomItem d) {
    const std::string source = d.items(DCM_RegistrationSequence)[1].required_text(DCM_FrameOfReferenceUID);
    const std::string ct = d.required_text(DCM_FrameOfReferenceUID);
    d.put(DCM_FrameOfReferenceUID, source);
    d.items(DCM_RegistrationSequence)[0].put(DCM_FrameOfReferenceUID, source);
    d.items(DCM_RegistrationSequence)[1].put(DCM_FrameOfReferenceUID, ct);
    d.put(DCM_Manufacturer, "Other");
  });
  const auto session = [&] {
    const CommandOutcome outcome = run({"--used", objects.string(), "--json", "--source-isocenter", "0,0,0"});
    EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
    return Json::parse(outcome.out)["sessions"][0];
  };
  EXPECT_TRUE(session()["used"]["lateral_mm"].is_null());
  EXPECT_THAT(session()["not_compared"], HasSubstr("and the session's CT has "));
}

TEST_F(AuditSetupCommandTest, WhatCannotBeAuditedIsAnError) {
  fs::create_directories(results());
  EXPECT_THAT(run().err, HasSubstr("holds no result of isoshift"));
  EXPECT_EQ(run({"--used", (folder_ / "nothing.csv").string()}).exit_status, 2);
  write_text(table(), "");
  EXPECT_EQ(run({"--used", table().string(), "--source-isocenter", "0,0,0"}).exit_status, 2);
}

}  // namespace
}  // namespace isoshift::audit_setup_command_test
