// Registrations of X-rays by a panel that does not lie where its files say, with machine profiles that know how.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/output_folder.h"
#include "base/signing_key.h"
#include "cli/console.h"
#include "geometry/imager_error.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::machine_profile_command_test {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

constexpr double kShiftMm = 3.0;          // of the panel, along y
constexpr double kByShiftMm = 2.0 / 3.0;  // of the setup error, per mm: SAD / SID

class MachineProfileCommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    ASSERT_EQ(run_command({"phantom", "-o", path("study"), "--voxel-mm", "2", "--image-pixels", "256", "--panel-shift",
                           fmt::format("0,{}", kShiftMm)})
                  .exit_status,
              kExitAccepted);
    write_text(path("physics.key"), new_signing_key());
    std::filesystem::permissions(path("physics.key"),
                                 std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    ASSERT_EQ(run_shell(fmt::format("openssl pkey -in {0} -pubout -out {0}.pub", path("physics.key"))).exit_status, 0);
  }
  static void TearDownTestSuite() { delete folder_; }

  static std::string path(const std::string& name) { return (*folder_ / name).string(); }

  // A profile that knows the panel's shift, in the words of isoshift qa geometry --json.
  static std::string profile(const std::string& name, bool corrects) {
    Json errors;
    for (const ImagerParameterInfo& info : imager_parameters())
      errors[std::string(info.key)] = {{"value", nullptr}, {"sigma", 0.02}, {"is_determined", false}};
    errors["shift_y_mm"]["value"] = kShiftMm;
    Json rule = {{"imager_errors", errors}};
    if (corrects) rule["correct_imager"] = true;
    write_text(path(name), Json{{"machine_profile", 1}, {"name", "Linac 3"}, {"images", {rule}}}.dump());
    return path(name);
  }

  static CommandOutcome register_with(const std::string& result, std::vector<std::string> more) {
    more.insert(more.begin(), {"register", path("study"), "-o", path(result)});
    return run_command(more);
  }
  static Json result_in(const std::string& result) {
    std::ifstream file(path(result) + "/result.json");
    return Json::parse(file);
  }
  // How far the setup error found lies from the truth along y.
  static double off_mm(const Json& result) {
    std::ifstream file(path("study/truth.json"));
    return result["setup_error"]["translation_mm"][1].get<double>() -
           Json::parse(file)["setup_error_room"]["translation_mm"][1].get<double>();
  }

  static TemporaryFolder* folder_;
};

TemporaryFolder* MachineProfileCommandTest::folder_ = nullptr;

TEST_F(MachineProfileCommandTest, ACouchAngleAgainstTheMeasuredOneNeedsAReview) {
  const Json rule = {{"couch_angle_deg", 2}};
  write_text(path("couch.json"), Json{{"machine_profile", 1}, {"name", "Linac 3"}, {"images", {rule}}}.dump());
  const CommandOutcome outcome = register_with("couch", {"--machine", path("couch.json")});
  EXPECT_EQ(outcome.exit_status, kExitReview);
  EXPECT_THAT(
      outcome.out,
      HasSubstr("the machine profile, which says 2, contradicts KV_G000: PatientSupportAngle (300A,0122) is 0"));
}

// Both views show the patient 2 mm off, and nothing in them can tell. A profile that knows it widens the uncertainty,
// so that the truth lies within two sigma, and the result needs a review.
TEST_F(MachineProfileCommandTest, KnownErrorsWidenTheUncertainty) {
  ASSERT_NE(register_with("plain", {}).exit_status, kExitFailed);
  const Json plain = result_in("plain");
  EXPECT_NEAR(std::abs(off_mm(plain)), kByShiftMm * kShiftMm, 0.2);
  EXPECT_LT(plain["uncertainty"]["translation_mm"][1].get<double>(), 0.2);
  EXPECT_TRUE(plain["uncertainty"]["by_imagers"].is_null());
  std::ifstream report(path("plain/report.txt"));
  const std::string text{std::istreambuf_iterator<char>(report), {}};
  EXPECT_THAT(text, HasSubstr("1 mm by which a receptor is off would be 0.67 mm"));

  const CommandOutcome outcome = register_with("known", {"--machine", profile("known.json", false)});
  EXPECT_EQ(outcome.exit_status, kExitReview) << outcome.err;
  const Json known = result_in("known");
  EXPECT_LT(std::abs(off_mm(known)), 2.0 * known["uncertainty"]["translation_mm"][1].get<double>());
  EXPECT_NEAR(known["uncertainty"]["translation_mm"][1].get<double>(), kByShiftMm * kShiftMm, 0.1);
  EXPECT_NEAR(std::sqrt(known["uncertainty"]["by_imagers"]["covariance"][1][1].get<double>()), kByShiftMm * kShiftMm,
              0.1);
  EXPECT_THAT(known["reasons"].dump(), HasSubstr("the target is uncertain along y"));
}

TEST_F(MachineProfileCommandTest, ASignedProfileCorrects) {
  const std::string file = profile("corrects.json", true);
  EXPECT_THAT(register_with("unsigned", {"--machine", file}).err, HasSubstr("must be signed"));
  EXPECT_FALSE(std::filesystem::exists(path("unsigned")));
  EXPECT_THAT(register_with("no-profile", {"--machine-key", path("physics.key.pub")}).err, HasSubstr("--machine"));
  ASSERT_EQ(
      run_shell(fmt::format("openssl pkeyutl -sign -rawin -inkey {0} -in {1} -out {1}.sig", path("physics.key"), file))
          .exit_status,
      0);
  const std::vector<std::string> with = {"--machine", file, "--machine-key", path("physics.key.pub")};
  const CommandOutcome outcome = register_with("corrected", with);
  ASSERT_NE(outcome.exit_status, kExitFailed) << outcome.err;
  const Json corrected = result_in("corrected");
  EXPECT_NEAR(off_mm(corrected), 0.0, 0.2);  // as near as voxels of 2 mm bring it
  EXPECT_LT(corrected["uncertainty"]["translation_mm"][1].get<double>(), 0.2);
  EXPECT_THAT(corrected["overrides"].dump(), HasSubstr("receptor corrected (shift y +3.00 mm)"));
  const CommandOutcome inspected =
      run_command({"inspect", path("study/RTIMAGE"), "--machine", file, "--machine-key", path("physics.key.pub")});
  EXPECT_EQ(inspected.exit_status, kExitAccepted) << inspected.err;
  EXPECT_THAT(inspected.out, HasSubstr("receptor corrected"));
}

}  // namespace
}  // namespace isoshift::machine_profile_command_test
