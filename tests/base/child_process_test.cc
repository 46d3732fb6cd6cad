#include "base/child_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include "base/error.h"

namespace isoshift {
namespace {

using namespace std::chrono_literals;

TEST(RunChild, TellsWhatItPrintedAndHowItEnded) {
  const ChildEnd end = run_child({"sh", "-c", "echo out; echo err >&2; exit 3"}, 1min);
  EXPECT_EQ(end.status, 3);
  EXPECT_EQ(end.output, "out\nerr");
  EXPECT_FALSE(end.is_late);
  EXPECT_EQ(run_child({"sh", "-c", "kill -9 $$"}, 1min).status, 128 + SIGKILL);
}

TEST(RunChild, EndsOneThatHangs) {
  const auto begin = std::chrono::steady_clock::now();
  const ChildEnd end = run_child({"sh", "-c", "echo begun; exec sleep 600"}, 300ms);
  EXPECT_TRUE(end.is_late);
  EXPECT_EQ(end.output, "begun");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 5min);
}

TEST(RunChild, AProgramThatIsNotThereIsAnError) { EXPECT_THROW(run_child({"isoshift-is-not-there"}, 1min), Error); }

}  // namespace
}  // namespace isoshift
