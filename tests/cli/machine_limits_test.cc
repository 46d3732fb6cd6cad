// What the program does where the machine gives it little: an error, and nothing half written.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/testdata.h"

namespace isoshift::machine_limits_test {
namespace {

// Registers a study behind `limit`. Unless that was done, nothing may be left.
CommandOutcome register_with(const std::string& limit) {
  const TemporaryFolder folder;
  const CommandOutcome outcome =
      run_shell(fmt::format("{}; {} register {} -o {} --preset fast 2>&1", limit, ISOSHIFT_PROGRAM,
                            testdata("head").string(), (folder / "out").string()));
  const bool is_done = outcome.exit_status == 0 || outcome.exit_status == 3;
  EXPECT_NE(is_done, std::filesystem::is_empty(folder.path())) << outcome.out;
  return outcome;
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(MachineLimitsTest, ASmallStackIsAnError) {
  const CommandOutcome outcome = register_with("ulimit -s 256");
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.out, testing::HasSubstr("ulimit -s 8192"));
}

TEST(MachineLimitsTest, FilesThatMayNotGrowLeaveNothing) { EXPECT_EQ(register_with("ulimit -f 8").exit_status, 1); }

// Wherever memory runs out: in our code, in GLib, or in fonts, which go on without it and crash.
TEST(MachineLimitsTest, LittleMemoryLeavesNothing) {
  for (int kilobytes = 200000; kilobytes <= 400000; kilobytes += 20000)
    EXPECT_NE(register_with(fmt::format("ulimit -v {}", kilobytes)).out, "");
}
#endif

}  // namespace
}  // namespace isoshift::machine_limits_test
