#include "workflow/room/engine_state.h"

#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::engine_state_test {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

// Its time goes on only when somebody waits.
class HandClock : public Clock {
 public:
  Time now() const override { return Time(past_); }
  fs::file_time_type file_time() const override { return begin_ + past_; }
  void wait(std::chrono::milliseconds length) override { past_ += length; }

 private:
  const fs::file_time_type begin_ = fs::file_time_type::clock::now();
  std::chrono::milliseconds past_ = 1h;
};

class EngineFileTest : public testing::Test {
 protected:
  std::optional<EngineSeen> seen() const { return read_engine_state(folder_.path(), clock_.file_time()); }

  TemporaryFolder folder_;
  HandClock clock_;
  EngineFile file_{folder_.path(), clock_};
  EngineState state_{.waiting = {{.name = "a",
                                  .patient_id = "7",
                                  .acquired = "AP",
                                  .why = "1 of 2",
                                  .has_failed = true,
                                  .options = {.own_xrays = {{"1.2", "AP 10:15:00"}},
                                              .plans = {{"1.3", "the RT Plan A"}, {"1.4", "the RT Plan B"}}}}},
                     .troubles = {"a server is down"}};
};

TEST_F(EngineFileTest, WhatTheEngineDoesIsRead) {
  EXPECT_FALSE(seen()) << "no engine has ever run here";
  file_.update(state_);
  ASSERT_TRUE(seen());
  EXPECT_EQ(seen()->state, state_);
  EXPECT_TRUE(seen()->runs());
}

TEST_F(EngineFileTest, AnEngineThatGivesNoSignOfLifeHasStopped) {
  file_.update(state_);
  for (int n = 0; n < 20; ++n) {
    clock_.wait(1s);
    file_.update(state_);
    EXPECT_TRUE(seen()->runs());
  }
  clock_.wait(9s);
  EXPECT_TRUE(seen()->runs());
  clock_.wait(2s);
  EXPECT_FALSE(seen()->runs());
  file_.update(state_);
  EXPECT_TRUE(seen()->runs());
}

TEST_F(EngineFileTest, AFileThatWasRemovedIsWrittenAgain) {
  file_.update(state_);
  fs::remove(folder_ / "engine.json");
  clock_.wait(3s);
  file_.update(state_);
  EXPECT_EQ(seen()->state, state_);
}

TEST_F(EngineFileTest, AnotherFileIsNotTakenForAnEngines) {
  std::ofstream(folder_ / "engine.json") << R"({"schema": 1})";
  EXPECT_THROW(seen(), Error);
}

}  // namespace
}  // namespace isoshift::engine_state_test
