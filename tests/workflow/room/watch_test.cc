#include "workflow/room/watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/output_folder.h"
#include "io/report/result_folder.h"
#include "tests/support/treatment_room.h"

namespace isoshift::watch_test {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using Xrays = std::set<std::string>;

// A patient P, with CT and plan, and a room in which the watch runs.
class WatchTest : public testing::Test {
 protected:
  WatchTest() {
    room_.start();
    bring_planning("P");
  }
  void bring_planning(const std::string& patient) {
    room_.source.bring(ct_of(patient));
    room_.source.bring(plan_of(patient));
  }
  void bring_pair(const std::string& patient, double second) {
    room_.source.bring(xray(patient, patient + "1", "AP", second));
    room_.source.bring(xray(patient, patient + "2", "LAT", second + 10));
  }
  // When the registrations began, after the time `from`.
  std::vector<std::chrono::seconds> beginnings(Clock::Time from) const {
    std::vector<std::chrono::seconds> all;
    for (const FakeRunner::Run& run : room_.runner.runs())
      all.push_back(std::chrono::duration_cast<std::chrono::seconds>(run.began - from));
    return all;
  }

  TreatmentRoom room_;
};

// A day on which the couch moves between 10:16 and 10:20; each X-ray comes 5 s after it was taken.
class CouchMoveDay : public WatchTest, public testing::WithParamInterface<bool> {
 protected:
  StudyFiles take(const std::string& uid, const std::string& label, double second, double vertical_mm) const {
    return xray("P", uid, label, second, GetParam() ? std::optional(vertical_mm) : std::nullopt);
  }
};

TEST_P(CouchMoveDay, ARetakeIsNeverRegisteredWithXraysFromAfterTheMove) {
  room_.source.bring(take("ap1", "AP", second_of(10, 15), -120.0));
  room_.pass(10s);
  room_.source.bring(take("lat1", "LAT", second_of(10, 15, 10), -120.0));
  room_.pass(50s);
  ASSERT_THAT(room_.runs(), ElementsAre(Xrays{"ap1", "lat1"}));
  room_.source.bring(take("lat2", "LAT", second_of(10, 16), -120.0));
  room_.pass(240s);
  room_.source.bring(take("ap3", "AP", second_of(10, 20), -117.0));
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(1)) << "registered before the LAT of the second session came";
  room_.source.bring(take("lat3", "LAT", second_of(10, 20, 10), -117.0));
  room_.pass(600s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"ap1", "lat1"}, Xrays{"ap3", "lat3"}));
  EXPECT_THAT(room_.index(), HasSubstr("LAT 2026-03-02 10:16:00"));
  EXPECT_THAT(room_.index(), HasSubstr("1 of 2 X-rays; LAT was taken again 50 s after /in/lat1"));
  EXPECT_THAT(room_.index(), HasSubstr("2 sessions registered, 1 waiting"));
}

INSTANTIATE_TEST_SUITE_P(TableReadOuts, CouchMoveDay, testing::Bool(),
                         [](const auto& row) { return row.param ? "Known" : "Absent"; });

TEST_F(WatchTest, NothingIsRegisteredBeforeItIsQuiet) {
  bring_pair("P", second_of(10, 15));
  room_.pass(8s);
  const Clock::Time last = room_.clock.now() + 1s;
  room_.source.bring(xray("P", "P2", "LAT", second_of(10, 15, 10)));  // once more: more files may arrive
  room_.pass(30s);
  EXPECT_THAT(beginnings(last), ElementsAre(10s));
}

TEST_F(WatchTest, WhatIsOnItsWayIsWaitedFor) {
  room_.source.set_coming(true);
  bring_pair("P", second_of(10, 15));
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), IsEmpty());
  EXPECT_THAT(room_.index(), HasSubstr("more files may arrive"));
  room_.source.set_coming(false);
  room_.pass(1s);
  EXPECT_THAT(room_.runs(), SizeIs(1));
}

TEST_F(WatchTest, AServerThatIsDownIsNotQuiet) {
  bring_pair("P", second_of(10, 15));
  room_.pass(5s);
  room_.source.set_down(true);
  room_.pass(600s);
  EXPECT_THAT(room_.runs(), IsEmpty());
  EXPECT_THAT(room_.index(), HasSubstr("Trouble: receiving: the server is down"));
  const Clock::Time up = room_.clock.now();
  room_.source.set_down(false);
  room_.pass(30s);
  EXPECT_THAT(beginnings(up), ElementsAre(10s));
  EXPECT_THAT(room_.observer.lines, testing::IsSupersetOf({"receiving: the server is down", "receiving: goes on"}));
  EXPECT_EQ(std::ranges::count(room_.observer.lines, "receiving: the server is down"), 1);
  EXPECT_THAT(room_.index(), Not(HasSubstr("Trouble")));
}

TEST_F(WatchTest, WhatIsMissingIsWaitedFor) {
  bring_pair("Q", second_of(10, 15));
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("waits for the CT"));
  room_.source.bring(ct_of("Q"));
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("waits for the RT Plan plan.Q"));
  EXPECT_THAT(room_.runs(), IsEmpty());
  room_.source.bring(plan_of("Q"));
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"Q1", "Q2"}));
}

TEST_F(WatchTest, AFailedRegistrationIsTriedAgainAfterLongerAndLongerTimes) {
  room_.runner.failure = {.why = "error: out of memory"};
  bring_pair("P", second_of(10, 15));
  room_.pass(11s);
  // It ends in the round after its beginning, from which the pause counts.
  const Clock::Time failed = room_.clock.now() + 1s;
  room_.pass(3000s);
  EXPECT_THAT(beginnings(failed), ElementsAre(-1s, 30s, 91s, 212s, 453s, 934s, 1535s, 2136s, 2737s));
  EXPECT_THAT(room_.index(), HasSubstr("error: out of memory"));
  EXPECT_EQ(std::ranges::count_if(room_.observer.lines, [](const auto& l) { return l.ends_with("out of memory"); }), 1);
}

TEST_F(WatchTest, AFailedRegistrationIsTriedAgainWhenMoreComes) {
  room_.runner.failure = {.why = "error: out of memory"};
  bring_pair("P", second_of(10, 15));
  room_.pass(1000s);  // the next pause is 10 minutes
  const std::size_t before = room_.runner.runs().size();
  room_.runner.failure.reset();
  const Clock::Time news = room_.clock.now() + 1s;
  room_.source.bring(ct_of("P"));
  room_.pass(20s);
  ASSERT_THAT(room_.runs(), SizeIs(before + 1));
  EXPECT_EQ(room_.runner.runs().back().began - news, 10s);
  EXPECT_THAT(room_.index(), HasSubstr("1 sessions registered, 0 waiting"));
}

TEST_F(WatchTest, ARegistrationThatNeverEndedIsTriedAgainOnlyWhenMoreComes) {
  room_.runner.failure = {.why = "the registration did not end within 30 minutes", .may_be_over_soon = false};
  room_.runner.length = 30min;
  bring_pair("P", second_of(10, 15));
  room_.pass(12h, 10s);
  EXPECT_THAT(room_.runs(), SizeIs(1));
  EXPECT_THAT(room_.index(), HasSubstr("did not end within 30 minutes"));
  room_.source.bring(ct_of("P"));
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(2));
}

TEST_F(WatchTest, TheNewestXraysAreRegisteredFirstAndFailedOnesLast) {
  room_.runner.length = 60s;
  for (const char* patient : {"Q", "R", "S"}) bring_planning(patient);
  room_.runner.failure = {.why = "error: out of memory"};
  bring_pair("S", second_of(12, 0));
  room_.pass(80s);
  room_.runner.failure.reset();
  bring_pair("P", second_of(10, 0));
  bring_pair("Q", second_of(11, 0));
  bring_pair("R", second_of(9, 0));
  room_.pass(400s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"S1", "S2"}, Xrays{"Q1", "Q2"}, Xrays{"P1", "P2"}, Xrays{"R1", "R2"},
                                        Xrays{"S1", "S2"}));
}

TEST_F(WatchTest, ARegisteredSessionIsNotRegisteredAgainAfterARestart) {
  bring_pair("P", second_of(10, 15));
  room_.pass(30s);
  room_.start();
  room_.pass(3600s, 10s);
  EXPECT_THAT(room_.runs(), SizeIs(1));
}

TEST_F(WatchTest, ADamagedResultHidesNoOtherAndIsNotReplaced) {
  bring_planning("Q");
  bring_pair("P", second_of(10, 15));
  room_.pass(30s);
  const std::string name = session_name({"P1", "P2"});
  const std::filesystem::path session = room_.file.results / "sessions" / name;
  replace_text(session / kResultFile, "{");
  room_.start();
  bring_pair("Q", second_of(11, 15));
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"P1", "P2"}, Xrays{"Q1", "Q2"}));
  EXPECT_THAT(room_.index(), HasSubstr("holds no readable result of these X-rays. Move it away"));
  std::filesystem::rename(session, room_.folder / "aside");
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"P1", "P2"}, Xrays{"Q1", "Q2"}, Xrays{"P1", "P2"}));
}

TEST_F(WatchTest, WhatAKilledWatchLeftHalfWrittenIsRemoved) {
  const std::filesystem::path left = room_.file.results / "sessions" / ".0123456789ab.registering-1";
  std::filesystem::create_directory(left);
  write_text(left / kResultFile, "{");
  room_.start();
  EXPECT_FALSE(std::filesystem::exists(left));
}

TEST_F(WatchTest, OneWatchAtATimeWorksOnAResultsTree) {
  FakeSource source(room_.clock);
  try {
    const Watch second(room_.file, {.source = source,
                                    .runner = room_.runner,
                                    .sender = room_.sender,
                                    .clock = room_.clock,
                                    .observer = room_.observer,
                                    .sending = room_.sending,
                                    .contents = room_.contents});
    FAIL() << "a second watch began";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("another isoshift room watch is working here"));
  }
}

// A broken file beside the X-rays may be the retake of one of them.
TEST_F(WatchTest, AFileThatCannotBeReadIsADoubtAndSaid) {
  bring_pair("P", second_of(10, 15));
  room_.source.broken = {"/elsewhere/x.dcm: is cut off"};
  room_.pass(20s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  EXPECT_THAT(room_.runner.runs()[0].doubts, IsEmpty());
  EXPECT_THAT(room_.index(), HasSubstr("Trouble: /elsewhere/x.dcm: is cut off"));
  bring_planning("Q");
  bring_pair("Q", second_of(10, 30));
  room_.source.broken = {"/in/x.dcm: is cut off"};
  room_.pass(20s);
  ASSERT_THAT(room_.runs(), SizeIs(2));
  EXPECT_THAT(room_.runner.runs()[1].doubts, ElementsAre(HasSubstr("may belong to them: /in/x.dcm: is cut off")));
  room_.source.broken = {};
  room_.pass(1s);
  EXPECT_THAT(room_.index(), Not(HasSubstr("is cut off")));
}

// Without the file of its lock, a watch could work beside another.
TEST_F(WatchTest, AWatchWithoutItsLockFileEnds) {
  room_.start();
  room_.pass(5s);
  std::filesystem::remove(room_.file.results / ".watch.lock");
  EXPECT_THROW(room_.watch->round(), Error);
  write_text(room_.file.results / ".watch.lock", "");
  EXPECT_THROW(room_.watch->run([] { return false; }), Error);
}

TEST_F(WatchTest, WhenItIsToldToEndItGivesUpTheRegistrationUnderWay) {
  room_.runner.length = 30min;
  bring_pair("P", second_of(10, 15));
  room_.pass(15s);
  ASSERT_TRUE(room_.runner.is_running());
  room_.watch->run([] { return true; });
  EXPECT_FALSE(room_.runner.is_running());
  room_.runner.length = 0s;
  room_.start();
  room_.pass(30s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"P1", "P2"}, Xrays{"P1", "P2"}));
  EXPECT_THAT(room_.index(), HasSubstr("1 sessions registered, 0 waiting"));
}

TEST_F(WatchTest, ObjectsOfAPatientAreForgottenAfter60DaysAndAskedForAgain) {
  bring_pair("P", second_of(10, 15));
  room_.pass(60s);
  room_.pass(59 * 24h, 1h);
  EXPECT_THAT(room_.source.patients(), SizeIs(1));
  room_.pass(2 * 24h, 1h);
  EXPECT_THAT(room_.source.patients(), IsEmpty());
  constexpr double kNextDay = 24 * 3600.0;
  room_.source.bring(xray("P", "P3", "AP", kNextDay + second_of(10, 0)));
  room_.source.bring(xray("P", "P4", "LAT", kNextDay + second_of(10, 0, 10)));
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"P1", "P2"}, Xrays{"P3", "P4"}));
}

}  // namespace
}  // namespace isoshift::watch_test
