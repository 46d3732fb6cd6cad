// The server as a process, with a real browser, or as a newcomer starts it.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "serve/pam.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::serve_test {
namespace {

TEST(Serve, IsUsedInTwoBrowsersWhileSessionsCome) {
  if (!std::filesystem::exists("/usr/bin/chromedriver")) GTEST_SKIP() << "chromium-driver is not installed";
  const TemporaryFolder work;
  const CommandOutcome used = run_shell(fmt::format("/usr/bin/python3 {}/tests/serve/screen_in_browser.py {} {}",
                                                    ISOSHIFT_SOURCE_DIR, ISOSHIFT_PROGRAM, (work / "").string()));
  EXPECT_EQ(used.exit_status, 0) << used.out;
}

TEST(Serve, InitLeadsFromNothingToAResultAtThePeer) {
  if (!std::filesystem::exists("/usr/sbin/Orthanc")) GTEST_SKIP() << "orthanc is not installed";
  const TemporaryFolder work;
  const CommandOutcome led = run_shell(fmt::format("/usr/bin/python3 {}/tests/serve/first_room.py {} {}",
                                                   ISOSHIFT_SOURCE_DIR, ISOSHIFT_PROGRAM, (work / "").string()));
  EXPECT_EQ(led.exit_status, 0) << led.out;
}

TEST(Serve, PamLetsNobodyInWithAWrongPassword) {
  EXPECT_FALSE(is_password_of("isoshift-test", "root", "surely not"));
  EXPECT_FALSE(is_password_of("isoshift-test", "no-such-user", ""));
}

}  // namespace
}  // namespace isoshift::serve_test
