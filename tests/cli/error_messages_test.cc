// What a user reads when something is wrong: exact messages and exit statuses.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <set>
#include <sstream>

#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/report/formats.h"
#include "io/report/result_folder.h"
#include "io/study/session_files.h"
#include "tests/support/command.h"
#include "tests/support/oblique_report.h"
#include "tests/support/small_study.h"
#include "tests/support/temporary_folder.h"
#include "workflow/room/results_tree.h"

namespace isoshift::error_messages_test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

class ErrorMessagesTest : public testing::Test {
 protected:
  // Registers, and expects failure with exactly this message, nothing on stdout and no result left behind.
  void expect_error(const std::string& message, std::vector<std::string> more = {}) {
    const CommandOutcome outcome = register_study(study_, std::move(more));
    EXPECT_EQ(outcome.exit_status, 1);
    EXPECT_EQ(outcome.err, "error: " + message + "\n");
    EXPECT_EQ(outcome.out, "");
    EXPECT_FALSE(std::filesystem::exists(study_.output()));
    for (const auto& entry : std::filesystem::directory_iterator(study_.output().parent_path()))
      EXPECT_THAT(entry.path().filename().string(), testing::Not(HasSubstr("partial")));
  }

  std::string where(const std::filesystem::path& path) { return path.string(); }

  SmallStudy study_;
};

TEST_F(ErrorMessagesTest, NoCt) {
  std::filesystem::remove_all(study_.path() / "CT");
  expect_error(
      fmt::format("no CT series found (searched {}).\n       Name its folder: --ct FOLDER", where(study_.path())));
}

TEST_F(ErrorMessagesTest, NamesCannotSteerATerminal) {
  const CommandOutcome outcome = run_command({"register", "no\x1b[2Jstudy", "-o", "unused"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, testing::Not(HasSubstr("\x1b")));
  EXPECT_THAT(outcome.err, HasSubstr("no [2Jstudy"));
  std::filesystem::copy(study_.plan(), study_.path() / "a\x1b[31mplan.dcm");
  const std::string listing = run_command({"inspect", study_.path().string()}).out;
  EXPECT_THAT(listing, testing::Not(HasSubstr("\x1b")));
  EXPECT_THAT(listing, HasSubstr("a [31mplan.dcm"));
}

TEST_F(ErrorMessagesTest, WhatStandsBeforeTheCommand) {
  const CommandOutcome outcome = run_command({"-o", "result", "register", "study"});
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("-o belongs behind the command: isoshift register ... -o"));
  EXPECT_EQ(run_command({"--version", "register"}).exit_status, 0);
}

// Of a script whose variable is unset, and of one that divided by zero.
TEST_F(ErrorMessagesTest, ArgumentsThatAreEmptyOrNoNumber) {
  const std::vector<std::string> start = {"register", study_.path().string(), "-o", study_.output().string()};
  const auto error_with = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = start;
    words.insert(words.end(), more.begin(), more.end());
    const CommandOutcome outcome = run_command(words);
    EXPECT_EQ(outcome.exit_status, 2);
    return outcome.err;
  };
  EXPECT_THAT(error_with({"--site", ""}), HasSubstr("--site: the argument is empty"));
  EXPECT_THAT(error_with({"--machine="}), HasSubstr("--machine: the argument is empty"));
  EXPECT_THAT(error_with({"--sid", "nan"}), HasSubstr("--sid: nan is not a finite number"));
  EXPECT_THAT(error_with({"--isocenter=1,-Inf,2"}), HasSubstr("--isocenter: -Inf is not a finite number"));
  EXPECT_FALSE(std::filesystem::exists(study_.output()));
}

TEST_F(ErrorMessagesTest, WholeNumbersAreDecimal) {
  const auto error_with = [](const std::string& flag, const std::string& number) {
    const CommandOutcome outcome = run_command({"phantom", "-o", "unused", flag, number});
    EXPECT_EQ(outcome.exit_status, 2) << flag << " " << number;
    return outcome.err;
  };
  for (const char* number : {"-1", "010", "0x10", "18446744073709551616", "1.5"})
    EXPECT_THAT(error_with("--seed", number),
                HasSubstr(fmt::format("--seed: {}: expected a whole number from 0 on in decimal digits", number)));
  EXPECT_THAT(error_with("--fractions", "07"), HasSubstr("--fractions: 07: expected a whole number in decimal digits"));
}

TEST_F(ErrorMessagesTest, TwoCtSeries) {
  for (const int k : {0, 1, 2}) edit(study_.ct_slice(k), [](DicomItem d) { d.put(DCM_SeriesInstanceUID, "1.2.3"); });
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, StartsWith("error: 2 CT series found, and the plan does not tell which one it was made "
                                      "on:\n       3 slices, series 1.2.3, first file " +
                                      where(study_.ct_slice(0)) + "\n"));
  EXPECT_THAT(outcome.err, testing::EndsWith("\n       Name the planning CT: --ct FOLDER\n"));
}

TEST(ReleaseCommandTest, TheNameOfWhoReleasesIsOneLineOfText) {
  for (const auto& [name, why] : {std::pair("", "the argument is empty"), std::pair("  ", "expected the name"),
                                  std::pair("J. Doe\nverdict accepted", "holds a line break"),
                                  std::pair("J. \xff\xfe", "is not valid UTF-8 text")}) {
    const CommandOutcome outcome = run_command({"room", "release", "3fa94c1e02b7", "--by", name});
    EXPECT_EQ(outcome.exit_status, 2) << name;
    EXPECT_THAT(outcome.err, HasSubstr(std::string("--by: ") + why));
  }
}

// While no watch runs, nothing tells whether another file has come in its place.
TEST(ReleaseCommandTest, WithoutAWatchNothingIsSentWhoseFilesAreGone) {
  const TemporaryFolder work;
  ResultsTree tree(work / "out");
  SetupResult result = oblique_report(Verdict::kAccepted);
  result.views.front().sop_instance_uid = "1.2.3";
  std::set<std::string> xrays;
  for (const SetupResult::View& view : result.views) xrays.insert(view.sop_instance_uid);
  const std::string session = session_name(xrays);
  std::filesystem::create_directories(tree.registering(session));
  write_text(tree.registering(session) / kResultFile, json_report(result));
  write_text(tree.registering(session) / "report.dcm", "a report");
  tree.keep_order(session, {.parts = {.plan = work / "plan.dcm"}});
  tree.publish(session, sha256_of_folder(tree.registering(session)));
  std::filesystem::create_directories(work / "in");
  std::ofstream(work / "site.json") << R"({"site_file": 1, "name": "S", "sessions": {"views": 2, "quiet_s": 1}})";
  std::ofstream(work / "watch.json")
      << R"({"watch_file": 1, "folder": "in", "results": "out", "site": "site.json", "peers": [{"name": "p",)"
      << R"( "host": "127.0.0.1", "port": 1, "called_aet": "P", "calling_aet": "I", "tls": false}]})";
  const CommandOutcome outcome =
      run_command({"room", "release", session, "--by", "J. Doe", "--watch", (work / "watch.json").string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, testing::AllOf(HasSubstr("plan.dcm: is gone"), testing::Not(HasSubstr("tried again"))));
  EXPECT_THAT(outcome.out, HasSubstr("not sent yet"));
}

TEST_F(ErrorMessagesTest, OneUidForTwoImages) {
  std::string uid;
  edit(study_.image(0), [&](DicomItem d) { uid = d.required_text(DCM_SOPInstanceUID); });
  edit(study_.image(1), [&](DicomItem d) { d.put(DCM_SOPInstanceUID, uid); });
  expect_error(fmt::format("{}: has the SOPInstanceUID (0008,0018) of {}, but shows something else",
                           where(study_.image(1)), where(study_.image(0))));
}

TEST_F(ErrorMessagesTest, ATableThatMovedInOneAxis) {
  for (const int n : {0, 1})
    edit(study_.image(n), [&](DicomItem d) {
      d.erase(DCM_ExposureSequence);
      d.erase(DCM_TableTopLateralPosition);
      d.erase(DCM_TableTopLongitudinalPosition);
      d.put(DCM_TableTopVerticalPosition, -150.0 + 50.0 * n);
    });
  expect_error(
      fmt::format("{}: the table moved by 50.0 mm since {} (TableTopVerticalPosition (300A,0128))\n"
                  "       If that is known to be right, allow it: --allow table-moved=REASON",
                  where(study_.image(1)), where(study_.image(0))));
}

TEST_F(ErrorMessagesTest, APatientPositionAgainstThePlan) {
  expect_error(
      fmt::format("--patient-position: PatientPosition (0018,5100) is HFP, that of {} is HFS", where(study_.plan())),
      {"--patient-position", "HFP"});
}

TEST_F(ErrorMessagesTest, MissingSlice) {
  std::string uid;
  edit(study_.ct_slice(20), [&](DicomItem d) { uid = d.required_text(DCM_SeriesInstanceUID); });
  std::filesystem::remove(study_.ct_slice(20));
  expect_error(fmt::format(
      "CT series {}: slices 20 and 21 are 12 mm apart, the others 6 mm (ImagePositionPatient (0020,0032)).\n"
      "       A uniform series is needed; a slice is probably missing.\n"
      "       If that is known to be right, allow it: --allow gaps=REASON",
      uid));
}

TEST_F(ErrorMessagesTest, UnevenSpacing) {
  std::string uid;
  // The upper half moves away by 2.5 mm, as if two scans had been joined.
  for (int k = 20; std::filesystem::exists(study_.ct_slice(k)); ++k)
    edit(study_.ct_slice(k), [&](DicomItem d) {
      uid = d.required_text(DCM_SeriesInstanceUID);
      auto position = d.numbers(DCM_ImagePositionPatient);
      position[2] += 2.5;
      d.put(DCM_ImagePositionPatient, position);
    });
  expect_error(fmt::format(
      "CT series {}: slices 20 and 21 are 8.5 mm apart, the others 6 mm (ImagePositionPatient (0020,0032)).\n"
      "       A uniform series is needed; this one has uneven spacing.\n"
      "       If that is known to be right, allow it: --allow gaps=REASON",
      uid));
}

TEST_F(ErrorMessagesTest, ImageWithoutSadOrSid) {
  edit(study_.image(0), [](DicomItem d) {
    d.erase(DCM_RadiationMachineSAD);
    d.erase(DCM_RTImageSID);
  });
  expect_error(
      fmt::format("{0}: RadiationMachineSAD (3002,0022) is missing.\n       Supply it: --sad MM\n"
                  "{0}: RTImageSID (3002,0026) is missing.\n       Supply it: --sid MM",
                  where(study_.image(0))));
}

TEST_F(ErrorMessagesTest, ImageWithoutPositionGantryAngleAndCouchAngle) {
  edit(study_.image(1), [](DicomItem d) {
    d.put(DCM_RTImagePosition, "");
    d.erase(DCM_GantryAngle);
    d.erase(DCM_PatientSupportAngle);
  });
  expect_error(fmt::format(
      "{0}: RTImagePosition (3002,0012) is missing.\n       Supply it: --rt-image-position X,Y or --assume-centered\n"
      "{0}: GantryAngle (300A,011E) is missing.\n       Supply it: --gantry-angle KV_G090=DEG\n"
      "{0}: PatientSupportAngle (300A,0122) is missing.\n       Supply it: --couch-angle DEG",
      where(study_.image(1))));
}

TEST_F(ErrorMessagesTest, DifferentPatients) {
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_PatientID, "SOMEONE ELSE"); });
  const std::string message =
      fmt::format("{}: PatientID (0010,0020) differs from that of the CT: the inputs are of different patients",
                  where(study_.image(0)));
  expect_error(message + "\n       If that is known to be right, allow it: --allow patient-mismatch=REASON");
}

TEST_F(ErrorMessagesTest, PatientsWithoutAnId) {
  for (const auto& path : {study_.image(0), study_.image(1)}) edit(path, [](DicomItem d) { d.put(DCM_PatientID, ""); });
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err,
              HasSubstr(where(study_.image(0)) + ": PatientID (0010,0020) is empty: whose it is is unknown"));
}

TEST_F(ErrorMessagesTest, PatientsOfDifferentNames) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_PatientName, "Other^Person"); });
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr(": PatientName (0010,0010) differs from that of the CT"));
  EXPECT_THAT(outcome.err, testing::Not(HasSubstr("Other^Person")));
}

TEST_F(ErrorMessagesTest, NamesThatDifferInEmptyComponentsOrCapitalsAreTheSame) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_PatientName, "PHANTOM^Digital^^^"); });
  EXPECT_EQ(register_study(study_).exit_status, 0);
}

// What the CT does not say, the plan and an X-ray may contradict each other in.
TEST_F(ErrorMessagesTest, EveryPairOfInputsIsOfOnePatient) {
  for (const DcmTagKey& tag : {DCM_PatientBirthDate, DCM_IssuerOfPatientID}) {
    SmallStudy study;
    const bool is_date = tag == DCM_PatientBirthDate;
    edit(study.plan(), [&](DicomItem d) { d.put(tag, is_date ? "19600101" : "A"); });
    edit(study.image(1), [&](DicomItem d) { d.put(tag, is_date ? "19600102" : "B"); });
    const CommandOutcome outcome = register_study(study);
    EXPECT_EQ(outcome.exit_status, 1);
    EXPECT_THAT(outcome.err,
                HasSubstr(fmt::format("{}: {} differs from that of {}: the inputs are of different patients",
                                      where(study.image(1)), described(tag), where(study.plan()))));
  }
}

TEST_F(ErrorMessagesTest, ADateWithDotsIsTheSameDate) {
  edit(study_.plan(), [](DicomItem d) { d.put(DCM_PatientBirthDate, "1960.01.01"); });
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_PatientBirthDate, "19600101"); });
  EXPECT_EQ(register_study(study_).exit_status, 0);
}

TEST_F(ErrorMessagesTest, AnIsocenterThatContradictsThePlan) {
  std::string frame;
  edit(study_.ct_slice(0), [&](DicomItem d) { frame = d.required_text(DCM_FrameOfReferenceUID); });
  edit(study_.image(1), [&](DicomItem d) {
    d.put(DCM_FrameOfReferenceUID, frame);
    d.put(DCM_IsocenterPosition, "0\\0\\5");
  });
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, StartsWith(fmt::format("error: {}: IsocenterPosition (300A,012C) is (0, 0, 5) mm, the "
                                                  "planned one is (",
                                                  where(study_.image(1)))));
  EXPECT_THAT(outcome.err, HasSubstr("--allow plan-mismatch=REASON"));
}

TEST_F(ErrorMessagesTest, APlanOfATreatmentDevice) {
  edit(study_.plan(), [](DicomItem d) { d.put(DCM_RTPlanGeometry, "TREATMENT_DEVICE"); });
  EXPECT_EQ(register_study(study_).exit_status, 0);  // its frame of reference says where its isocenter lies
  edit(study_.plan(), [](DicomItem d) { d.erase(DCM_FrameOfReferenceUID); });
  const CommandOutcome outcome = register_study(study_, {"--overwrite"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("RTPlanGeometry (300A,000C) is TREATMENT_DEVICE: nothing says where its isocenter "
                                     "lies in the CT\n       If that is known to be right, allow it: --allow "
                                     "for-mismatch=REASON"));
}

TEST_F(ErrorMessagesTest, AnIntensityThatSaysNothing) {
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_PixelIntensityRelationship, "DISP"); });
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_PixelIntensityRelationshipSign, 0); });
  expect_error(
      fmt::format("{}: PixelIntensityRelationship (0028,1040) is \"DISP\", which does not tell.\n"
                  "       Supply it: --intensity LIN+|LIN-|LOG+|LOG-\n"
                  "{}: PixelIntensityRelationshipSign (0028,1041) is \"0\", which does not tell.\n"
                  "       Supply it: --intensity LIN+|LIN-|LOG+|LOG-",
                  where(study_.image(0)), where(study_.image(1))));
}

TEST_F(ErrorMessagesTest, APipeIsNoFile) {
  const std::filesystem::path pipe = study_.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"check", pipe.string()},
        {"inspect", pipe.string()},
        {"register", study_.path().string(), "-o", study_.output().string(), "--plan", pipe.string()},
        {"register", study_.path().string(), "-o", study_.output().string(), "--truth", pipe.string()},
        {"predict", pipe.string()},
        {"register", study_.path().string(), "-o", "x", "--machine", pipe.string()}}) {
    const CommandOutcome outcome = run_command(words);
    EXPECT_EQ(outcome.exit_status, 1) << words.front();
    EXPECT_THAT(outcome.out + outcome.err, HasSubstr("is a pipe, a socket or a device, expected a file"));
  }
}

TEST_F(ErrorMessagesTest, WhatIsNoUid) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_SeriesInstanceUID, "../../x"); });
  expect_error(
      fmt::format("{}: SeriesInstanceUID (0020,000E) is \"../../x\", which is no UID: expected at most 64 "
                  "digits and dots",
                  where(study_.image(1))));
}

TEST_F(ErrorMessagesTest, AnXrayOfNoStudy) {
  edit(study_.image(1), [](DicomItem d) { d.erase(DCM_StudyInstanceUID); });
  expect_error(
      fmt::format("{}: StudyInstanceUID (0020,000D) is missing.\n       No switch supplies it: the image cannot "
                  "be used.",
                  where(study_.image(1))));
}

TEST_F(ErrorMessagesTest, BlankXray) {
  edit(study_.image(0), [](DicomItem d) { d.put_pixels(std::vector<std::uint16_t>(96 * 96, 0)); });
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("KV_G000: the X-ray is blank: its intensities run from 0 to 0"));
}

TEST_F(ErrorMessagesTest, ImageAndPlanThatDoNotBelongTogether) {
  std::string plan_uid;
  edit(study_.plan(), [&](DicomItem d) { plan_uid = d.required_text(DCM_SOPInstanceUID); });
  edit(study_.image(1),
       [](DicomItem d) { d.items(DCM_ReferencedRTPlanSequence)[0].put(DCM_ReferencedSOPInstanceUID, "1.2.3"); });
  expect_error(
      fmt::format("{}: belongs to another plan than {} (ReferencedRTPlanSequence (300C,0002)): it refers to 1.2.3, "
                  "the plan is {}\n"
                  "       If that is known to be right, allow it: --allow plan-mismatch=REASON",
                  where(study_.image(1)), where(study_.plan()), plan_uid));
}

TEST_F(ErrorMessagesTest, PlanInAnotherFrameOfReference) {
  edit(study_.plan(), [](DicomItem d) { d.put(DCM_FrameOfReferenceUID, "1.2.3"); });
  expect_error(fmt::format(
      "{}: FrameOfReferenceUID (0020,0052) is not that of the CT, so the plan's isocenter does not apply to it\n"
      "       If that is known to be right, allow it: --allow for-mismatch=REASON",
      where(study_.plan())));
}

TEST_F(ErrorMessagesTest, TableMovedBetweenTheViews) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_PatientSupportAngle, 2.0); });
  expect_error(
      fmt::format("{}: the table turned by 2.0 degrees since {} (PatientSupportAngle (300A,0122))\n"
                  "       If that is known to be right, allow it: --allow table-moved=REASON",
                  where(study_.image(1)), where(study_.image(0))));
}

TEST_F(ErrorMessagesTest, ViewsTooFarApartInTime) {
  edit(study_.image(1), [](DicomItem d) { d.put(DCM_AcquisitionTime, "104500"); });
  expect_error(fmt::format(
      "{}: taken 1800 s from {}, expected at most 600 (AcquisitionTime (0008,0032))\n"
      "       Of several sessions isoshift batch registers each, and --latest, --date, --fraction or --session "
      "chooses one.\n"
      "       If that is known to be right, allow it: --allow time-span=REASON",
      where(study_.image(1)), where(study_.image(0))));
}

TEST_F(ErrorMessagesTest, IsocenterOutsideTheCt) {
  expect_error("the isocenter (500.0, 0.0, 0.0) mm lies outside the CT (IsocenterPosition (300A,012C))",
               {"--isocenter", "500,0,0"});
}

TEST_F(ErrorMessagesTest, NoPlan) {
  std::filesystem::remove(study_.plan());
  expect_error(
      fmt::format("no RT Plan found (searched {}), so the planned isocenter is unknown.\n"
                  "       Name the plan (--plan FILE) or supply the isocenter: --isocenter X,Y,Z",
                  where(study_.path())));
}

TEST_F(ErrorMessagesTest, FilesThatWereCutOff) {
  const std::filesystem::path slice = study_.ct_slice(3);
  for (const std::uintmax_t bytes : {std::filesystem::file_size(slice) - 100, std::uintmax_t{700}}) {
    std::filesystem::resize_file(slice, bytes);
    const CommandOutcome outcome = register_study(study_);
    EXPECT_EQ(outcome.exit_status, 1);
    EXPECT_THAT(outcome.err, StartsWith("error: " + where(slice) +
                                        ": ends before what its elements announce: the file has been cut off"));
  }
}

TEST_F(ErrorMessagesTest, OutputFolderAlreadyHoldingAResult) {
  std::filesystem::create_directory(study_.output());
  std::ofstream(study_.output() / "result.json") << "precious";
  const CommandOutcome outcome = register_study(study_);
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_EQ(outcome.err, fmt::format("error: {}: the output folder is not empty.\n"
                                     "       Name another one, or replace what it holds: --overwrite\n",
                                     where(study_.output())));
  std::ifstream file(study_.output() / "result.json");
  std::string content;
  file >> content;
  EXPECT_EQ(content, "precious");
}

TEST_F(ErrorMessagesTest, DiskFull) {
  const std::filesystem::path disk = study_.output().parent_path() / "disk";
  std::filesystem::create_directory(disk);
  if (run_shell(fmt::format("mount -t tmpfs -o size=64k tmpfs {}", disk.string())).exit_status != 0)
    GTEST_SKIP() << "no tmpfs can be mounted here; needs root";
  const CommandOutcome outcome = run_command({"register", study_.path().string(), "-o", (disk / "result").string()});
  int left = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(disk)) ++left;
  run_shell(fmt::format("umount {}", disk.string()));
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("cannot be written: No space left on device\n       No result was left behind\n"));
  EXPECT_EQ(left, 0);
}

TEST_F(ErrorMessagesTest, UsageErrorsHaveTheirOwnStatus) {
  EXPECT_EQ(run_command({}).exit_status, 2);
  EXPECT_EQ(run_command({"registre"}).exit_status, 2);
  EXPECT_EQ(run_command({"register", where(study_.path())}).exit_status, 2);  // no -o
  EXPECT_EQ(register_study(study_, {"--intensity", "LINEAR"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--allow", "everything=please"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--allow", "gaps"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--gantry-angle", "KV_G000=north"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--gantry-angle", "NOBODY=0"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--gantry-angle", "KV_G000=0", "--gantry-angle", "KV_G000=9"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--attenuation", "windowed", "--window", "100,-100"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--gantry-angle", "KV_G000=nan"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--couch-angle", "nan"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--couch-pitch", "nan"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--couch-roll", "inf"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--isocenter", "nan,nan,nan"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--sid", "inf"}).exit_status, 2);
  EXPECT_EQ(register_study(study_, {"--seed", "-1"}).exit_status, 2);
  EXPECT_EQ(run_command({"register", "-o", where(study_.output())}).exit_status, 2);
  EXPECT_EQ(run_command({"register", where(study_.path()), "-o", ""}).exit_status, 2);
}

TEST_F(ErrorMessagesTest, AnEmptyDrrIsAnError) {
  const CommandOutcome outcome =
      run_command({"drr", study_.path().string(), "-o", study_.output().string(), "--threshold-hu", "9000"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(
      outcome.err,
      testing::EndsWith("error: KV_G000: the DRR is empty: no ray meets anything above the threshold in the CT\n"));
  EXPECT_FALSE(std::filesystem::exists(study_.output()));
}

TEST_F(ErrorMessagesTest, RegisteringAnEmptyDrrIsAnErrorToo) {
  const CommandOutcome outcome = register_study(study_, {"--threshold-hu", "9000"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("the DRR is empty"));
}

}  // namespace
}  // namespace isoshift::error_messages_test
