#include "workflow/room/child_runner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>
#include <iterator>
#include <thread>

#include "base/output_folder.h"
#include "tests/support/temporary_folder.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::HasSubstr;

// A shell script stands in for isoshift register.
class ChildRunnerTest : public testing::Test {
 protected:
  ChildRunnerTest() {
    file_.site.path = folder_ / "site.json";
    file_.registration = {"--preset=fast"};
  }
  ~ChildRunnerTest() override { use_program(ISOSHIFT_PROGRAM); }

  void begin(Runner& runner, const std::string& script) {
    const fs::path program = folder_ / "program";
    write_text(program, "#!/bin/sh\ncd " + folder_.path().string() + "\n" + script + "\n");
    fs::permissions(program, fs::perms::owner_all);
    use_program(program);
    runner.begin({.ct = {"/in/ct1", "/in/ct2"}, .images = {"/in/ap", "/in/lat"}, .plan = "/in/plan"}, folder_ / "out");
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
  WatchFile file_;
};

TEST_F(ChildRunnerTest, RegistersThePartsUnderTheSiteFile) {
  ChildRunner runner(file_);
  begin(runner, "echo $* >words; mkdir out; echo {} >out/result.json; exit 3");
  EXPECT_FALSE(end_of(runner).failure);
  EXPECT_EQ(text_of("words"), "register --ct /in/ct1 /in/ct2 --image /in/ap /in/lat --plan /in/plan --site " +
                                  file_.site.path.string() + " --output " + (folder_ / "out").string() +
                                  " --preset=fast\n");
}

TEST_F(ChildRunnerTest, TheErrorThatWasPrintedIsTheReason) {
  ChildRunner runner(file_);
  begin(runner, "echo warning: x; echo 'error: no CT\n       Name its folder' >&2; exit 1");
  const Runner::End end = end_of(runner);
  ASSERT_TRUE(end.failure);
  EXPECT_EQ(end.failure->why, "error: no CT\n       Name its folder");
  EXPECT_TRUE(end.failure->may_be_over_soon);
}

TEST_F(ChildRunnerTest, AnEndWithoutAResultIsAFailure) {
  ChildRunner runner(file_);
  begin(runner, "kill -SEGV $$");
  const Runner::End end = end_of(runner);
  ASSERT_TRUE(end.failure);
  EXPECT_THAT(end.failure->why, HasSubstr("ended with status 139 and left no result"));
}

TEST_F(ChildRunnerTest, ARegistrationThatDoesNotEndIsEnded) {
  ChildRunner runner(file_, 300ms);
  begin(runner, "echo $$ >process; exec sleep 600");
  const Runner::End end = end_of(runner);
  ASSERT_TRUE(end.failure);
  EXPECT_EQ(end.failure->why, "the registration did not end within 0.005 minutes");
  EXPECT_FALSE(end.failure->may_be_over_soon);
  EXPECT_NE(::kill(std::stoi(text_of("process")), 0), 0) << "it still runs";
}

TEST_F(ChildRunnerTest, WhatIsGivenUpEnds) {
  ChildRunner runner(file_);
  begin(runner, "echo $$ >process; exec sleep 600");
  while (!text_of("process").ends_with('\n')) std::this_thread::sleep_for(5ms);
  EXPECT_FALSE(runner.end());
  runner.give_up();
  EXPECT_NE(::kill(std::stoi(text_of("process")), 0), 0) << "it still runs";
}

}  // namespace
}  // namespace isoshift
