#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/small_study.h"

namespace isoshift {
namespace {

using testing::HasSubstr;

class CheckCommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    study_ = new SmallStudy;
    ASSERT_EQ(register_study(*study_).exit_status, 0);
  }
  static void TearDownTestSuite() { delete study_; }

  std::string ours() const { return (study_->output() / "spatial_registration.dcm").string(); }

  // A copy of ours with the inverse of its matrix.
  std::string inverted() const {
    const std::filesystem::path copy = folder_ / "inverted.dcm";
    std::filesystem::copy_file(ours(), copy, std::filesystem::copy_options::overwrite_existing);
    edit(copy, [](DicomItem d) {
      DicomItem item =
          d.items(DCM_RegistrationSequence)[1].items(DCM_MatrixRegistrationSequence)[0].items(DCM_MatrixSequence)[0];
      const std::vector<double> values = item.required_numbers(DCM_FrameOfReferenceTransformationMatrix, 16);
      const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> inverse =
          Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data()).inverse();
      item.put(DCM_FrameOfReferenceTransformationMatrix, std::span(inverse.data(), 16));
    });
    return copy.string();
  }

  static SmallStudy* study_;
  TemporaryFolder folder_;
};
SmallStudy* CheckCommandTest::study_ = nullptr;

TEST_F(CheckCommandTest, OursPassesAndMeansTheShiftOfTheReport) {
  const CommandOutcome outcome = run_command({"check", ours(), "--plan", study_->plan().string(), "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto checked = nlohmann::json::parse(outcome.out)["registrations"][0];
  EXPECT_TRUE(checked["passes"].get<bool>());
  std::ifstream file(study_->output() / "result.json");
  const auto reported = nlohmann::json::parse(file)["couch_shift"];
  for (const char* axis : {"lateral_mm", "longitudinal_mm", "vertical_mm", "yaw_deg", "pitch_deg", "roll_deg"})
    EXPECT_NEAR(checked["couch_shift"][axis].get<double>(), reported[axis].get<double>(), 1e-6) << axis;
  EXPECT_THAT(run_command({"check", ours()}).out, HasSubstr("spatial_registration.dcm: passes"));
}

TEST_F(CheckCommandTest, AnInvertedOneIsFoundByThePlanAndByItsPair) {
  const CommandOutcome by_plan = run_command({"check", inverted(), "--plan", study_->plan().string()});
  EXPECT_EQ(by_plan.exit_status, 1);
  EXPECT_THAT(by_plan.out, HasSubstr("the matrix looks inverted"));
  const CommandOutcome by_pair = run_command({"check", ours(), inverted()});
  EXPECT_EQ(by_pair.exit_status, 1);
  EXPECT_THAT(by_pair.out, HasSubstr("the second one looks inverted"));
}

TEST_F(CheckCommandTest, OneFromTheRoomMeansTheSameShift) {
  const std::string from_room = (folder_ / "from_room").string();
  ASSERT_EQ(
      run_command({"register", study_->path().string(), "-o", from_room, "--source-for", "iec-fixed"}).exit_status, 0);
  const std::string theirs = from_room + "/spatial_registration.dcm", plan = study_->plan().string();
  const CommandOutcome outcome = run_command({"check", ours(), theirs, "--plan", plan, "--couch-angle", "0", "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto checked = nlohmann::json::parse(outcome.out);
  for (const char* axis : {"lateral_mm", "longitudinal_mm", "vertical_mm", "yaw_deg", "pitch_deg", "roll_deg"})
    EXPECT_NEAR(checked["registrations"][0]["couch_shift"][axis].get<double>(),
                checked["registrations"][1]["couch_shift"][axis].get<double>(), 1e-6)
        << axis;
  EXPECT_THAT(checked["difference"]["reason"].get<std::string>(), HasSubstr("compare their shifts"));
}

// The frame of images may begin anywhere: without the isocenter in it nothing is told, with it the same shift.
TEST_F(CheckCommandTest, OneFromTheImagesFrameNeedsTheirIsocenter) {
  const SmallStudy with_frame;
  for (const int n : {0, 1})
    edit(with_frame.image(n), [](DicomItem d) {
      d.put(DCM_FrameOfReferenceUID, "1.2.3.4");
      d.put(DCM_IsocenterPosition, std::array{20.0, -50.0, 60.0});
    });
  ASSERT_EQ(register_study(with_frame).exit_status, 0);
  const std::string theirs = (with_frame.output() / "spatial_registration.dcm").string();
  const std::string plan = study_->plan().string();
  const CommandOutcome without = run_command({"check", theirs, "--plan", plan});
  EXPECT_THAT(without.out, HasSubstr("its source frame is that of images"));
  EXPECT_THAT(without.out, testing::Not(HasSubstr("couch shift")));
  EXPECT_THAT(run_command({"check", ours(), theirs}).out, HasSubstr("difference: none"));

  const CommandOutcome with =
      run_command({"check", ours(), theirs, "--plan", plan, "--source-isocenter", "20,-50,60", "--json"});
  const auto checked = nlohmann::json::parse(with.out);
  for (const char* axis : {"lateral_mm", "longitudinal_mm", "vertical_mm", "yaw_deg"})
    EXPECT_NEAR(checked["registrations"][0]["couch_shift"][axis].get<double>(),
                checked["registrations"][1]["couch_shift"][axis].get<double>(), 1e-6)
        << axis;
}

TEST_F(CheckCommandTest, TheSameTwiceDoesNotDiffer) {
  const CommandOutcome outcome = run_command({"check", ours(), ours()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("difference: 0.000 mm at the isocenter, 0.000 deg"));
}

TEST_F(CheckCommandTest, TheShiftNeedsIsocenterAndPosition) {
  const CommandOutcome outcome = run_command({"check", ours(), "--isocenter", "1,2,3"});
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--patient-position"));
  EXPECT_EQ(run_command({"check", study_->plan().string()}).exit_status, 1);
  const CommandOutcome endless = run_command({"check", ours(), "--isocenter", "nan,2,3", "--patient-position", "HFS"});
  EXPECT_EQ(endless.exit_status, 2);
  EXPECT_THAT(endless.err, HasSubstr("--isocenter and --couch-angle take finite numbers"));
}

}  // namespace
}  // namespace isoshift
