// A folder of several sessions: which of them is registered.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"
#include "workflow/register/truth.h"

namespace isoshift::session_choice_command_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

using Strings = std::vector<std::string>;

// Two fractions, a day apart.
class SessionChoiceCommandTest : public testing::Test {
 protected:
  SessionChoiceCommandTest() {
    std::filesystem::copy(testdata("small/1"), study_, std::filesystem::copy_options::recursive);
  }
  CommandOutcome register_with(Strings choice) const {
    choice.insert(choice.begin(), {"register", study_.string(), "-o", output_.string(), "--overwrite"});
    return run_command(choice);
  }
  Eigen::Isometry3d found() const { return read_setup_error(output_ / "result.json"); }
  // FractionNumber of the X-rays of both days.
  void number_fractions() const {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(study_ / "RTIMAGE"))
      if (entry.is_regular_file()) {
        const bool is_second = entry.path().string().find("/F02/") != std::string::npos;
        edit(entry.path(), [&](DicomItem d) { d.put(DCM_FractionNumber, is_second ? 2.0 : 1.0); });
      }
  }

  TemporaryFolder folder_;
  std::filesystem::path study_ = folder_ / "study", output_ = folder_ / "out";
  const Eigen::Isometry3d first_ = read_setup_error(testdata("small/1/truth.json"));
  const Eigen::Isometry3d second_ = read_setup_error(testdata("small/1/truth_F02.json"));
};

TEST_F(SessionChoiceCommandTest, WithoutAChoiceNothingIsRegistered) {
  const CommandOutcome outcome = register_with({});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("--latest, --date, --fraction or --session chooses one"));
}

TEST_F(SessionChoiceCommandTest, TheLatestIsChosen) {
  const CommandOutcome outcome = register_with({"--latest"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(found(), PoseNear(second_, 0.5, 3.0));
  EXPECT_THAT(outcome.err, HasSubstr("KV_G000.dcm: an X-ray of another session"));
}

TEST_F(SessionChoiceCommandTest, ADayIsChosen) {
  ASSERT_EQ(register_with({"--date", "2026-03-01"}).exit_status, 0);
  EXPECT_THAT(found(), PoseNear(first_, 0.5, 3.0));
  ASSERT_EQ(register_with({"--date", "2026-03-02"}).exit_status, 0);
  EXPECT_THAT(found(), PoseNear(second_, 0.5, 3.0));
  EXPECT_GT((first_.translation() - second_.translation()).norm(), 1.0);
  const CommandOutcome none = register_with({"--date", "2026-03-03"});
  EXPECT_EQ(none.exit_status, 1);
  EXPECT_THAT(none.err, AllOf(HasSubstr("there is no session of 2026-03-03. The sessions are:"),
                              HasSubstr(": 2026-03-01 10:15:00, KV_G000, KV_G090")));
  EXPECT_EQ(register_with({"--date", "yesterday"}).exit_status, 2);
}

TEST_F(SessionChoiceCommandTest, ASessionThatGoesOnAfterMidnightIsOfBothDays) {
  edit(study_ / "RTIMAGE/KV_G000.dcm", [](DicomItem d) { d.put(DCM_AcquisitionTime, "235950"); });
  edit(study_ / "RTIMAGE/KV_G090.dcm", [](DicomItem d) {
    d.put(DCM_AcquisitionDate, "20260302");
    d.put(DCM_AcquisitionTime, "000010");
  });
  EXPECT_EQ(register_with({"--date", "2026-03-01"}).exit_status, 0);
  EXPECT_THAT(found(), PoseNear(first_, 0.5, 3.0));
  EXPECT_THAT(register_with({"--date", "2026-03-02"}).err, HasSubstr("2 sessions are of 2026-03-02"));
}

TEST_F(SessionChoiceCommandTest, AFractionIsChosenWhereTheXraysNumberIt) {
  const CommandOutcome unknown = register_with({"--fraction", "2"});
  EXPECT_EQ(unknown.exit_status, 1);
  EXPECT_THAT(unknown.err, HasSubstr("FractionNumber (3002,0029) is missing or differs within the session"));
  number_fractions();
  ASSERT_EQ(register_with({"--fraction", "2"}).exit_status, 0);
  EXPECT_THAT(found(), PoseNear(second_, 0.5, 3.0));
  EXPECT_THAT(register_with({"--fraction", "1", "--date", "2026-03-02"}).err,
              HasSubstr("there is no session of 2026-03-02, of fraction 1"));
}

TEST_F(SessionChoiceCommandTest, SessionsWithoutANumberDoNotHideTheFractionThatIsAskedFor) {
  for (const char* name : {"KV_G000.dcm", "KV_G090.dcm"})
    edit(study_ / "RTIMAGE/F02" / name, [](DicomItem d) { d.put(DCM_FractionNumber, 2.0); });
  ASSERT_EQ(register_with({"--fraction", "2"}).exit_status, 0);
  EXPECT_THAT(found(), PoseNear(second_, 0.5, 3.0));
  EXPECT_THAT(register_with({"--fraction", "1"}).err, HasSubstr("FractionNumber (3002,0029) is missing or differs"));
}

TEST_F(SessionChoiceCommandTest, ASessionOfWhichOnlySomeXraysHaveTheFractionIsNotPassedOver) {
  number_fractions();
  edit(study_ / "RTIMAGE/KV_G090.dcm", [](DicomItem d) { d.put(DCM_FractionNumber, 2.0); });
  const CommandOutcome outcome = register_with({"--fraction", "2"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("only some X-rays are of fraction 2"));
}

// The clock of an imager that is a century ahead.
TEST_F(SessionChoiceCommandTest, XraysFromTheFutureAreNotTheLatest) {
  for (const char* name : {"KV_G000.dcm", "KV_G090.dcm"})
    edit(study_ / "RTIMAGE" / name, [](DicomItem d) { d.put(DCM_AcquisitionDate, "21260301"); });
  const CommandOutcome outcome = register_with({"--latest"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("was taken at 2126-03-01 10:15:00, in the future: a clock is wrong"));
  EXPECT_EQ(register_with({"--date", "2026-03-02"}).exit_status, 0);
}

TEST_F(SessionChoiceCommandTest, ASessionIsChosenByTheNameThatInspectGives) {
  number_fractions();
  const CommandOutcome inspected = run_command({"inspect", study_.string(), "--json"});
  ASSERT_EQ(inspected.exit_status, 0) << inspected.err;
  const auto sessions = nlohmann::json::parse(inspected.out)["sessions"];
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_EQ(sessions[0]["acquired"], "2026-03-01 10:15:00");
  EXPECT_EQ(sessions[0]["fraction"], 1);
  EXPECT_EQ(sessions[0]["images"],
            nlohmann::json({(study_ / "RTIMAGE/KV_G000.dcm").string(), (study_ / "RTIMAGE/KV_G090.dcm").string()}));
  const std::string name = sessions[0]["name"];
  EXPECT_THAT(run_command({"inspect", study_.string()}).out,
              HasSubstr("session " + name + ": 2026-03-01 10:15:00, fraction 1, KV_G000, KV_G090"));
  ASSERT_EQ(register_with({"--session", name.substr(0, 6)}).exit_status, 0);
  EXPECT_THAT(found(), PoseNear(first_, 0.5, 3.0));
  EXPECT_THAT(register_with({"--session", "nobody"}).err, HasSubstr("there is no session named nobody"));
  EXPECT_EQ(register_with({"--session", name, "--image", (study_ / "RTIMAGE").string()}).exit_status, 2);
}

TEST_F(SessionChoiceCommandTest, OfTwoOfTheSameTimeNoneIsTheLatest) {
  for (const char* name : {"KV_G000.dcm", "KV_G090.dcm"})
    edit(study_ / "RTIMAGE/F02" / name, [&](DicomItem d) {
      const DicomFile first = DicomFile::read(study_ / "RTIMAGE" / name, DicomFile::Extent::kHeader);
      for (const DcmTagKey& tag : {DCM_AcquisitionDate, DCM_AcquisitionTime})
        d.put(tag, first.dataset().required_text(tag));
    });
  const CommandOutcome outcome = register_with({"--latest"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("their times do not tell which was taken later"));
}

// PS3.3 C.12.1.1.8: from -1200 to +1400.
TEST_F(SessionChoiceCommandTest, AZoneThatThereIsNotMovesNoTime) {
  for (const char* zone : {"+9999", "+1401", "+0060", "-1201"}) {
    for (const char* name : {"KV_G000.dcm", "KV_G090.dcm"})
      edit(study_ / "RTIMAGE/F02" / name, [&](DicomItem d) { d.put(DCM_TimezoneOffsetFromUTC, zone); });
    const CommandOutcome outcome = register_with({"--latest"});
    ASSERT_EQ(outcome.exit_status, 0) << zone;
    EXPECT_THAT(outcome.err, HasSubstr(fmt::format("TimezoneOffsetFromUTC (0008,0201) is \"{}\", expected", zone)));
    EXPECT_THAT(found(), PoseNear(second_, 0.5, 3.0)) << zone;
  }
}

// Who has no time may be the latest.
TEST_F(SessionChoiceCommandTest, WithoutTimesNoneIsTheLatest) {
  edit(study_ / "RTIMAGE/F02/KV_G000.dcm", [](DicomItem d) {
    d.erase(DCM_AcquisitionDate);
    d.erase(DCM_AcquisitionTime);
    d.erase(DCM_RTImageLabel);
    for (const DcmTagKey& tag : {DCM_ContentDate, DCM_ContentTime, DCM_InstanceCreationDate, DCM_InstanceCreationTime})
      d.erase(tag);
  });
  const CommandOutcome outcome = register_with({"--latest"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("their times do not tell which was taken later"));
}

// Whose X-ray is the last in a folder of many is not who is meant.
TEST_F(SessionChoiceCommandTest, OfSeveralPatientsNoneIsChosen) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(study_ / "RTIMAGE/F02"))
    edit(entry.path(), [](DicomItem d) { d.put(DCM_PatientID, "OTHER"); });
  const CommandOutcome outcome = register_with({"--latest"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("the sessions that fit are of several patients. The sessions are:"));
}

}  // namespace
}  // namespace isoshift::session_choice_command_test
