// isoshift qa commission, from results of sessions to what is signed.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/output_folder.h"
#include "base/sha256.h"
#include "base/signing_key.h"
#include "cli/console.h"
#include "geometry/rotation.h"
#include "io/report/result_folder.h"
#include "tests/support/command.h"
#include "tests/support/findings.h"
#include "tests/support/oblique_report.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::commission_command_test {
namespace {

using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

std::string text_in(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class CommissionCommandTest : public testing::Test {
 protected:
  void SetUp() override {
    write_text(
        folder_ / "site.json",
        R"({"site_file": 1, "name": "Linac 3", "localization_limits": {"translation_mm": 1, "rotation_deg": 1}})");
    write_text(folder_ / "key.pem", new_signing_key());
    std::filesystem::permissions(folder_ / "key.pem", std::filesystem::perms::owner_read);
  }

  // A session that found its phantom there, as a batch would leave it.
  void add(const std::string& name, const Eigen::Vector3d& mm, const Eigen::Vector3d& deg,
           Verdict verdict = Verdict::kAccepted, bool is_searched = true) {
    SetupResult result = oblique_report(verdict);
    for (SetupResult::View& view : result.views) view.sop_instance_uid += fmt::format(".{}", number_);
    ++number_;
    result.is_searched = is_searched;
    result.setup_error.translation() = mm;
    result.setup_error.linear() =
        rotation_from_zxy({rad_from_deg(deg.z()), rad_from_deg(deg.x()), rad_from_deg(deg.y())});
    result.uncertainty = uncertainty_of_independent_axes({0.1, 0.1, 0.1}, Eigen::Vector3d::Constant(0.001));
    result.findings = findings_for(verdict, "nothing matches");
    const std::filesystem::path where = folder_ / "results" / "cases" / name;
    std::filesystem::create_directories(where);
    write_result(result, where);
    poses_ += fmt::format("{},{},{},{},{},{},{}\n", name, mm.x(), mm.y(), mm.z(), deg.x(), deg.y(), deg.z());
  }

  void add_all_moves() {
    add("zero", {0, 0, 0}, {0, 0, 0});
    add("translated", {3, -4, 5}, {0, 0, 0});
    add("turned", {0, 0, 0}, {2, -2, 2});
  }

  CommandOutcome run(std::vector<std::string> flags) {
    replace_text(folder_ / "poses.csv", poses_);
    flags.insert(flags.begin(), {"qa", "commission", (folder_ / "results").string()});
    return run_command(flags);
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  TemporaryFolder folder_;
  int number_ = 1;
  std::string poses_ = "session,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\n";
};

TEST_F(CommissionCommandTest, SessionsThatProveEverythingPass) {
  add_all_moves();
  const CommandOutcome outcome = run({"--moves", path("poses.csv"), "--site", path("site.json")});
  EXPECT_EQ(outcome.exit_status, kExitAccepted) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("PASSED: every test below, for what was tested"));
  EXPECT_THAT(outcome.out, HasSubstr("patient positions: FFDL, FFDR, FFP, FFS, HFDL, HFDR, HFP"));
  EXPECT_THAT(outcome.out, HasSubstr("couch angles, degrees: 10"));
}

TEST_F(CommissionCommandTest, WhatWasNotTestedIsNamed) {
  add("zero", {0, 0, 0}, {0, 0, 0});
  add("translated", {3, 0, 0}, {0, 0, 0});
  const CommandOutcome outcome = run({"--moves", path("poses.csv")});
  EXPECT_EQ(outcome.exit_status, kExitReview);
  EXPECT_THAT(outcome.out, HasSubstr("polarity of y (to the gantry), z (up), about x"));
  EXPECT_THAT(outcome.out, HasSubstr("the site's limits: no site file was given (--site)"));
}

TEST_F(CommissionCommandTest, AWrongSignFails) {
  add_all_moves();
  poses_.replace(poses_.find("3,-4,5"), 6, "3,4,5");
  const CommandOutcome outcome = run({"--moves", path("poses.csv"), "--site", path("site.json"), "--json"});
  EXPECT_EQ(outcome.exit_status, kExitRejected);
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["outcome"], "FAILED");
  EXPECT_EQ(json["axes"]["y_mm"]["polarity"], "FAILED");
  EXPECT_EQ(json["axes"]["x_mm"]["polarity"], "passed");
}

TEST_F(CommissionCommandTest, ATableInAnotherUnitIsNotTestedUntilItSaysSo) {
  add_all_moves();
  for (const char* known : {"--positions", "--moves"}) {
    poses_ = "session,x_mm,y_mm,z_mm\nzero,0,0,0\ntranslated,0.3,-0.4,0.5\nturned,0,0,0\n";
    const CommandOutcome refused = run({known, path("poses.csv")});
    EXPECT_EQ(refused.exit_status, 1);
    EXPECT_EQ(refused.out, "");
    EXPECT_THAT(refused.err, HasSubstr("10 times x_mm (off by 0"));
    EXPECT_THAT(refused.err, HasSubstr("if that is right, name the column x_cm"));
    poses_ = "session,x_cm,y_cm,z_cm\nzero,0,0,0\ntranslated,0.3,-0.4,0.5\nturned,0,0,0\n";
    EXPECT_EQ(run({known, path("poses.csv")}).exit_status, 3) << "not all of it is tested";
  }
}

TEST_F(CommissionCommandTest, RejectedAndFailedSessionsAreNamedAndFail) {
  add_all_moves();
  add("bad", {1, 1, 1}, {0, 0, 0}, Verdict::kRejected);
  std::filesystem::create_directories(folder_ / "results" / "cases" / "broken");
  write_text(folder_ / "results" / "cases" / "broken" / "error.json", R"({"schema": 1, "error": "no plan"})");
  const CommandOutcome outcome = run({"--moves", path("poses.csv"), "--site", path("site.json")});
  EXPECT_EQ(outcome.exit_status, kExitRejected);
  EXPECT_THAT(outcome.out, HasSubstr("left out: bad: rejected: nothing matches"));
  EXPECT_THAT(outcome.out, HasSubstr("left out: broken: registration failed: no plan"));
}

// A commissioning is of one machine and one way of registering, and moves are within one CT.
TEST_F(CommissionCommandTest, SessionsThatDifferInWhatIsTestedAreRefused) {
  const auto refusal = [&](const std::string& known, const std::string& key, const nlohmann::json& value) {
    std::filesystem::remove_all(folder_ / "results");
    poses_ = poses_.substr(0, poses_.find('\n') + 1);
    add_all_moves();
    const std::filesystem::path path_of_one = folder_ / "results" / "cases" / "turned" / "result.json";
    Json json = Json::parse(text_in(path_of_one));
    json[Json::json_pointer(key)] = value;
    replace_text(path_of_one, json.dump());
    const CommandOutcome outcome = run({known, path("poses.csv"), "--site", path("site.json")});
    return fmt::format("{}: {}", outcome.exit_status, outcome.err);
  };
  EXPECT_THAT(refusal("--positions", "/views/0/radiation_machine", "Linac 4"), HasSubstr("1: error: sessions"));
  EXPECT_THAT(refusal("--positions", "/views/0/radiation_machine", "Linac 4"),
              HasSubstr("differ in their Radiation Machine Name"));
  EXPECT_THAT(refusal("--positions", "/program/commit", "0123abc"), HasSubstr("differ in their program"));
  EXPECT_THAT(refusal("--moves", "/references/ct_sha256", std::string(64, 'a')), HasSubstr("differ in their CT"));
  EXPECT_THAT(refusal("--positions", "/references/ct_sha256", std::string(64, 'a')), HasSubstr("0: "));
}

// The truth as a start that was only judged proves nothing.
TEST_F(CommissionCommandTest, PosesThatWereSetProveNothing) {
  add_all_moves();
  add("by-hand", {3, 3, 3}, {1, 1, 1}, Verdict::kReview, false);
  const CommandOutcome outcome = run({"--positions", path("poses.csv"), "--site", path("site.json")});
  EXPECT_EQ(outcome.exit_status, kExitRejected);
  EXPECT_THAT(outcome.out, HasSubstr("left out: by-hand: its pose was set, not searched"));
}

TEST_F(CommissionCommandTest, WithoutAnySessionThereIsNothingToSay) {
  add("bad", {1, 1, 1}, {0, 0, 0}, Verdict::kRejected);
  const CommandOutcome outcome = run({"--positions", path("poses.csv")});
  EXPECT_EQ(outcome.exit_status, kExitFailed);
  EXPECT_THAT(outcome.err, HasSubstr("no result can be used"));
  EXPECT_THAT(outcome.err, HasSubstr("bad: rejected: nothing matches"));
}

TEST_F(CommissionCommandTest, NoXrayCountsTwice) {
  add_all_moves();
  std::filesystem::copy(folder_ / "results" / "cases" / "zero", folder_ / "results" / "cases" / "copy");
  poses_ += "copy,0,0,0,0,0,0\n";
  const CommandOutcome outcome = run({"--positions", path("poses.csv")});
  EXPECT_EQ(outcome.exit_status, kExitFailed);
  EXPECT_THAT(outcome.err, HasSubstr("are of the same X-ray"));
}

// Only positions show what all sessions share.
TEST_F(CommissionCommandTest, MovesDoNotTestWhatAllSessionsShare) {
  add_all_moves();
  EXPECT_THAT(run({"--moves", path("poses.csv")}).out, HasSubstr("errors that all sessions share"));
  EXPECT_THAT(run({"--positions", path("poses.csv")}).out, Not(HasSubstr("errors that all sessions share")));
}

TEST_F(CommissionCommandTest, FilesAreSigned) {
  add_all_moves();
  const CommandOutcome outcome = run({"--positions", path("poses.csv"), "--site", path("site.json"), "-o", path("out"),
                                      "--by", "J. Doe", "--key", path("key.pem")});
  EXPECT_EQ(outcome.exit_status, kExitAccepted) << outcome.err;
  const std::string json = text_in(folder_ / "out" / "commission.json");
  const Json read = Json::parse(json);
  EXPECT_EQ(read["files_sha256"]["commission.pdf"], sha256_of_file(folder_ / "out" / "commission.pdf"));
  EXPECT_EQ(read["files_sha256"]["commission.csv"], sha256_of_file(folder_ / "out" / "commission.csv"));
  EXPECT_EQ(read["by"], "J. Doe");
  // The way of docs/commands/commission.md, by another program.
  const std::string verify = fmt::format(
      "cd {} && openssl pkey -in key.pem -pubout -out pub.pem && openssl pkeyutl -verify -pubin -inkey pub.pem -rawin "
      "-in out/commission.json -sigfile out/commission.json.sig",
      folder_.path().string());
  EXPECT_EQ(run_shell(verify).exit_status, 0);
  const VerifyingKey key(folder_ / "pub.pem");
  const std::string signature = text_in(folder_ / "out" / "commission.json.sig");
  EXPECT_TRUE(key.accepts(json, signature));
  EXPECT_FALSE(key.accepts(json + " ", signature));
  EXPECT_FALSE(key.accepts(json, signature.substr(1)));
  EXPECT_FALSE(key.accepts(json, ""));
}

TEST_F(CommissionCommandTest, WhatCannotBeDoneIsRefused) {
  add_all_moves();
  const auto refusal = [&](const std::vector<std::string>& flags) {
    const CommandOutcome outcome = run(flags);
    EXPECT_THAT(outcome.exit_status, testing::AnyOf(kExitFailed, kExitUsage));
    return outcome.err;
  };
  EXPECT_THAT(refusal({}), HasSubstr("its X-rays do not say where the table stood"));
  EXPECT_THAT(refusal({"--moves", path("poses.csv"), "--positions", path("poses.csv")}), HasSubstr("give one of them"));
  EXPECT_THAT(refusal({"--moves", path("poses.csv"), "-o", path("out"), "--key", path("key.pem")}), HasSubstr("--by"));
  write_text(folder_ / "no-limits.json", R"({"site_file": 1, "name": "A"})");
  EXPECT_THAT(refusal({"--moves", path("poses.csv"), "--site", path("no-limits.json")}),
              HasSubstr("has no localization_limits"));
  poses_ += "other,0,0,0,0,0,0\n";
  EXPECT_THAT(refusal({"--moves", path("poses.csv")}), HasSubstr("names session other"));
  std::filesystem::create_directories(folder_ / "empty");
  const CommandOutcome empty = run_command({"qa", "commission", path("empty")});
  EXPECT_EQ(empty.exit_status, kExitFailed);
  EXPECT_THAT(empty.err, HasSubstr("isoshift batch"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

}  // namespace
}  // namespace isoshift::commission_command_test
