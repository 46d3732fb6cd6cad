#include "workflow/room/child_runner.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>
#include <iterator>
#include <thread>

#include "base/output_folder.h"
#include "tests/support/temporary_folder.h"
#include "workflow/register/registration_messages.h"

namespace isoshift::child_runner_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::HasSubstr;

// A shell script stands in for isoshift.
class ChildRunnerTest : public testing::Test {
 protected:
  ~ChildRunnerTest() override { use_program(ISOSHIFT_PROGRAM); }

  void begin(Runner& runner, const std::string& script) {
    const fs::path program = folder_ / "program";
    fs::remove(program);
    write_text(program, "#!/bin/sh\ncd " + folder_.path().string() + "\n" + script + "\n");
    fs::permissions(program, fs::perms::owner_all);
    use_program(program);
    runner.begin(
        {.parts = parts_, .flags = {"--preset=fast"}, .site = folder_ / "site.json", .output = folder_ / "out"});
  }
  static Runner::End end_of(Runner& runner) {
    for (;;) {
      if (const auto end = runner.end()) return *end;
      std::this_thread::sleep_for(5ms);
    }
  }
  std::string text_of(const std::string& name) const {
    std::ifstream file(folder_ / name);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  TemporaryFolder folder_;
  const StudyParts parts_ = {.ct = {"/in/ct1", "/in/ct2"}, .images = {"/in/ap", "/in/lat"}, .plan = "/in/plan"};
};

TEST_F(ChildRunnerTest, RegistersWhatIsOrdered) {
  ChildRunner runner;
  const Ended ended{.verdict = Verdict::kReview, .files = {{"result.json", "its SHA-256"}}};
  write_text(folder_ / "answer", to_line(RegistrationMessage(Ready())) + to_line(RegistrationMessage(ended)));
  begin(runner, "echo $* >words; cat >order; mkdir out; echo {} >out/result.json; cat answer; exit 3");
  const Runner::End end = end_of(runner);
  EXPECT_FALSE(end.failure);
  EXPECT_EQ(end.files, ended.files);
  EXPECT_EQ(text_of("words"), "__child register\n");
  EXPECT_EQ(
      registration_order_from(text_of("order"), "the order"),
      (RegistrationOrder{
          .parts = parts_, .flags = {"--preset=fast"}, .site = folder_ / "site.json", .output = folder_ / "out"}));
}

TEST_F(ChildRunnerTest, TheFailureThatIsAnsweredIsTheReason) {
  ChildRunner runner;
  write_text(folder_ / "answer", to_line(RegistrationMessage(Ready())) +
                                     to_line(RegistrationMessage(Failed{"no CT\n       Name its folder"})));
  begin(runner, "echo 'error: of a library' >&2; cat answer");
  const Runner::End end = end_of(runner);
  ASSERT_TRUE(end.failure);
  EXPECT_EQ(end.failure->why, "error: no CT\n       Name its folder");
  EXPECT_TRUE(end.failure->may_be_over_soon);
}

TEST_F(ChildRunnerTest, AnAnswerThatIsNoneIsAFailureThatNamesTheChild) {
  ChildRunner runner;
  begin(runner, "echo hello");
  EXPECT_THAT(end_of(runner).failure.value().why, HasSubstr("the message of the registration: is not JSON"));
  begin(runner, "echo '{\"begun\":{}}'");
  EXPECT_THAT(end_of(runner).failure.value().why, HasSubstr("the message of the registration: there is no key begun"));
}

// The program itself answers, not a script.
TEST_F(ChildRunnerTest, TheErrorOfTheProgramIsTheReason) {
  use_program(ISOSHIFT_PROGRAM);
  ChildRunner runner;
  runner.begin({.parts = parts_, .site = folder_ / "site.json", .output = folder_ / "out"});
  EXPECT_EQ(end_of(runner).failure.value().why,
            fmt::format("error: {}: cannot be read", (folder_ / "site.json").string()));
}

TEST_F(ChildRunnerTest, AnEndWithoutAResultIsAFailure) {
  ChildRunner runner;
  begin(runner, "echo 'driver: lost' >&2; kill -SEGV $$");
  const Runner::End end = end_of(runner);
  ASSERT_TRUE(end.failure);
  EXPECT_THAT(end.failure->why, HasSubstr("ended with status 139 and left no result: driver: lost"));
}

// Of a child that was killed before it could say which files are its own.
TEST_F(ChildRunnerTest, AFolderThatTheChildDoesNotAnswerForIsNoResult) {
  ChildRunner runner;
  begin(runner, "mkdir out; echo {} >out/result.json");
  EXPECT_THAT(end_of(runner).failure.value().why, HasSubstr("ended with status 0 and left no result"));
}

TEST_F(ChildRunnerTest, ARegistrationThatDoesNotEndIsEnded) {
  ChildRunner runner(300ms);
  begin(runner, "echo $$ >process; exec sleep 600");
  const Runner::End end = end_of(runner);
  ASSERT_TRUE(end.failure);
  EXPECT_EQ(end.failure->why, "the registration did not end within 0.005 minutes");
  EXPECT_FALSE(end.failure->may_be_over_soon);
  EXPECT_NE(::kill(std::stoi(text_of("process")), 0), 0) << "it still runs";
}

TEST_F(ChildRunnerTest, WhatIsGivenUpEnds) {
  ChildRunner runner;
  begin(runner, "echo $$ >process; exec sleep 600");
  while (!text_of("process").ends_with('\n')) std::this_thread::sleep_for(5ms);
  EXPECT_FALSE(runner.end());
  runner.give_up();
  EXPECT_NE(::kill(std::stoi(text_of("process")), 0), 0) << "it still runs";
}

}  // namespace
}  // namespace isoshift::child_runner_test
