// A treatment room, with Orthanc servers of the test's own.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "tests/support/small_study.h"

namespace isoshift::room_test {
namespace {

namespace fs = std::filesystem;

TEST(Watch, RegistersWhatComesAndSendsWhatIsReleasedOnce) {
  if (!fs::exists("/usr/sbin/Orthanc")) GTEST_SKIP() << "Orthanc is not installed";
  const TemporaryFolder work;
  const CommandOutcome checked =
      run_shell(fmt::format("/usr/bin/python3 {}/tests/workflow/room/watch_with_orthanc.py {} {}", ISOSHIFT_SOURCE_DIR,
                            ISOSHIFT_PROGRAM, (work / "").string()));
  std::ifstream log(work / "watch.log");
  EXPECT_EQ(checked.exit_status, 0) << checked.out << std::string(std::istreambuf_iterator<char>(log), {});
}

TEST(Watch, InTroubleLosesNothingAndLetsNobodyElseWait) {
  const TemporaryFolder work;
  const CommandOutcome checked =
      run_shell(fmt::format("/usr/bin/python3 {}/tests/workflow/room/watch_in_trouble.py {} {}", ISOSHIFT_SOURCE_DIR,
                            ISOSHIFT_PROGRAM, (work / "").string()));
  std::ifstream log(work / "watch.log");
  EXPECT_EQ(checked.exit_status, 0) << checked.out << std::string(std::istreambuf_iterator<char>(log), {});
}

TEST(Watch, SendsNothingThatWasExchangedCopiedOrReleasedByNobody) {
  if (run_shell("command -v storescp").exit_status != 0) GTEST_SKIP() << "storescp (dcmtk) is not installed";
  const TemporaryFolder work;
  const CommandOutcome checked =
      run_shell(fmt::format("/usr/bin/python3 {}/tests/workflow/room/watch_and_forgers.py {} {}", ISOSHIFT_SOURCE_DIR,
                            ISOSHIFT_PROGRAM, (work / "").string()));
  std::ifstream log(work / "watch.log");
  EXPECT_EQ(checked.exit_status, 0) << checked.out << std::string(std::istreambuf_iterator<char>(log), {});
}

// 100 kills were seen once (docs/commands/watch.md); a few in every run.
TEST(Watch, KillsOfEngineServerAndBrowsersLoseAndDoubleNothing) {
  if (!fs::exists("/usr/sbin/Orthanc")) GTEST_SKIP() << "Orthanc is not installed";
  const TemporaryFolder work;
  const CommandOutcome checked = run_shell(fmt::format("/usr/bin/python3 {}/tests/workflow/room/kills.py {} {} 6 3",
                                                       ISOSHIFT_SOURCE_DIR, ISOSHIFT_PROGRAM, (work / "").string()));
  std::ifstream log(work / "watch.log");
  EXPECT_EQ(checked.exit_status, 0) << checked.out << std::string(std::istreambuf_iterator<char>(log), {});
}

TEST(Watch, FollowsAFolder) {
  const TemporaryFolder work;
  const SmallStudy study;
  fs::create_directories(work / "in");
  std::ofstream(work / "site.json") << R"({"site_file": 1, "name": "S", "sessions": {"views": 2, "quiet_s": 1},)"
                                    << R"( "release": {"rule": "automatic", "by": "J. Doe", "on": "2026-03-01"}})";
  std::ofstream(work / "watch.json") << R"({"watch_file": 1, "folder": "in", "results": "out", "site": "site.json"})";
  // Copies of a file count once, one that is no DICOM not at all; the watch ends when it is asked to.
  const CommandOutcome outcome = run_shell(fmt::format(
      "cd {0} && ({1} room watch watch.json & watch=$!; cp -r {2} in/study; cp in/study/RTPLAN.dcm in/again.dcm; echo "
      "x > "
      "in/x; "
      "for n in $(seq 120); do ls out/sessions/*/result.json >/dev/null 2>&1 && break; sleep 0.5; done; sleep 3; "
      "kill $watch; wait $watch)",
      (work / "").string(), ISOSHIFT_PROGRAM, study.path().string()));
  EXPECT_EQ(outcome.exit_status, 0) << outcome.out;
  EXPECT_EQ(std::distance(fs::directory_iterator(work / "out" / "sessions"), {}), 1);
  std::ifstream index(work / "out" / "index.html");
  const std::string page{std::istreambuf_iterator<char>(index), {}};
  EXPECT_THAT(page, testing::HasSubstr("sessions/"));
  const auto session = fs::directory_iterator(work / "out" / "sessions")->path();
  ASSERT_TRUE(fs::exists(session / "spatial_registration.dcm")) << outcome.out;  // it was accepted
  std::ifstream released(work / "out" / "released" / (session.filename().string() + ".json"));
  const std::string record{std::istreambuf_iterator<char>(released), {}};
  EXPECT_THAT(record, testing::HasSubstr("automatic, allowed by J. Doe on 2026-03-01"));
}

TEST(Watch, FlagsOfTheFileAreCheckedAtStart) {
  const TemporaryFolder work;
  fs::create_directories(work / "in");
  std::ofstream(work / "site.json") << R"({"site_file": 1, "name": "S", "sessions": {"views": 2, "quiet_s": 1}})";
  for (const char* flag : {"--preste=fast", "--anatomy=pelvis", "--allow=everything", "--site=other.json"}) {
    std::ofstream(work / "watch.json") << R"({"watch_file": 1, "folder": "in", "results": "out", "site": "site.json",)"
                                       << R"( "register": [")" << flag << R"("]})";
    const CommandOutcome outcome = run_command({"room", "watch", (work / "watch.json").string()});
    EXPECT_EQ(outcome.exit_status, 1) << flag;
    EXPECT_THAT(outcome.err, testing::HasSubstr("watch.json: register: ")) << flag;
  }
}

}  // namespace
}  // namespace isoshift::room_test
