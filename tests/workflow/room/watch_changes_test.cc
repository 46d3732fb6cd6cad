// What changes after a registration: late slices, another plan.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/sha256.h"
#include "tests/support/watch_releases.h"

namespace isoshift::watch_changes_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;
using testing::UnorderedElementsAre;

class WatchChanges : public WatchReleases {
 protected:
  WatchChanges() { register_first("P"); }
  void revise_plan() {
    room_.contents.written["/in/plan.P"] = "revised";
    room_.source.bring(plan_of("P"));
  }
  // A second plan, with X-rays that do not tell which is meant.
  void make_plan_of_q_unclear() {
    for (StudyFiles image : {xray("Q", "Q1", "AP", second_of(11, 15)), xray("Q", "Q2", "LAT", second_of(11, 15, 10))}) {
      image.images[0].plan_uid = "";
      room_.source.bring(image);
    }
    room_.source.bring(ct_of("Q"));
    room_.source.bring(plan_of("Q"));
    room_.pass(60s);
    StudyFiles second = plan_of("Q");
    second.plans[0].file = "/in/second";
    second.plans[0].sop_instance_uid = "second";
    room_.source.bring(second);
    room_.pass(60s);
  }
  // A result of a patient's X-rays by hand, made from what they were registered from last, and handed over.
  void hand_over(const std::string& patient) {
    ResultsTree tree(room_.file.results);
    const fs::path folder = room_.folder / "by_hand";
    fs::remove_all(folder);
    fs::copy(tree.session(session(patient)), folder);
    tree.hand_over(tree.manual_basis(session(patient)), {.folder = folder, .files = sha256_of_folder(folder)}, "jdoe");
  }
  std::vector<std::string> sessions() const { return ResultsTree(room_.file.results).sessions(); }
};

TEST_F(WatchChanges, LateSlicesAndARevisedPlanSupersedeAResult) {
  ASSERT_THAT(room_.runs(), SizeIs(1));
  bring_late_slice("P");
  room_.pass(60s);
  EXPECT_THAT(sessions(), UnorderedElementsAre(session("P"), session("P") + "-2"));
  EXPECT_THAT(room_.index(), HasSubstr("CT changed after the registration"));
  EXPECT_THAT(room_.index(), HasSubstr("superseded by session " + session("P") + "-2"));
  revise_plan();
  room_.pass(60s);
  EXPECT_THAT(sessions(), SizeIs(3));
  EXPECT_THAT(room_.index(), HasSubstr("RT Plan changed after the registration"));
  room_.pass(3600s, 10s);
  room_.start();
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(3)) << "for nothing";
}

TEST_F(WatchChanges, WhatWasRegisteredFromOtherFilesIsNotReleased) {
  room_.runner.length = 600s;
  revise_plan();
  room_.pass(30s);
  EXPECT_THAT(error_of_release("P"), HasSubstr("RT Plan changed after the registration"));
  EXPECT_THAT(room_.index(), HasSubstr("is being registered"));
  room_.pass(600s, 10s);
  EXPECT_THAT(error_of_release("P"), HasSubstr("have a newer result"));
}

TEST_F(WatchChanges, WhatWasReleasedAndNotSentStays) {
  room_.sender.down = {"record", "archive"};
  release("P");
  room_.pass(5s);
  revise_plan();
  room_.pass(30s);
  room_.sender.down = {};
  room_.pass(3600s, 10s);
  EXPECT_THAT(room_.sender.stored(), SizeIs(0));
}

// Its files are compared when no more of them come, and nothing is sent before.
TEST_F(WatchChanges, WhatIsReleasedBeforeAReplacedPlanIsComparedIsNotSent) {
  revise_plan();
  room_.pass(2s);
  release("P");
  room_.pass(3600s, 10s);
  EXPECT_THAT(room_.sender.attempts(), SizeIs(0));
  EXPECT_THAT(objection(session("P")), HasSubstr("RT Plan changed after the registration"));
  EXPECT_THAT(sessions(), SizeIs(2));
}

// The plan is replaced, and its result released, between two rounds; then sending comes first.
TEST_F(WatchChanges, WhatIsReleasedAfterTheSourceWasReadWaitsUntilItIsReadAgain) {
  revise_plan();
  release("P");
  room_.watch->deliver({});
  EXPECT_THAT(room_.sender.attempts(), SizeIs(0));
  room_.pass(3600s, 10s);
  EXPECT_THAT(room_.sender.attempts(), SizeIs(0));
  EXPECT_THAT(objection(session("P")), HasSubstr("RT Plan changed after the registration"));
}

TEST_F(WatchChanges, ARestartIsNoWayAroundTheComparison) {
  revise_plan();
  room_.pass(2s);
  release("P");
  room_.start();
  room_.source.bring(plan_of("P"));
  room_.pass(3600s, 10s);
  EXPECT_THAT(room_.sender.attempts(), SizeIs(0));
}

TEST_F(WatchChanges, TheRuleReleasesNothingThatWasRegisteredFromAPlanThatIsReplacedMeanwhile) {
  allow_automatic_release();
  room_.runner.length = 30s;
  room_.start();
  bring("Q");
  room_.pass(30s);
  ASSERT_TRUE(room_.runner.is_running());
  room_.pass(8s);
  room_.contents.written["/in/plan.Q"] = "revised";
  room_.source.bring(plan_of("Q"));
  room_.pass(3600s, 10s);
  EXPECT_FALSE(is_released("Q"));
  EXPECT_THAT(room_.sender.attempts(), SizeIs(0));
}

TEST_F(WatchChanges, WhatTheSameFilesCameAgainForIsSent) {
  room_.source.bring(plan_of("P"));
  room_.pass(2s);
  release("P");
  room_.pass(2s);
  EXPECT_THAT(room_.sender.attempts(), SizeIs(0)) << "before they were compared";
  room_.pass(60s);
  EXPECT_THAT(room_.sender.stored(), SizeIs(4));
}

TEST_F(WatchChanges, TheSameContentsSentAgainChangeNothing) {
  room_.source.bring(plan_of("P"));
  room_.source.bring(ct_of("P"));
  room_.pass(600s);
  EXPECT_THAT(room_.runs(), SizeIs(1));
  EXPECT_EQ(error_of_release("P"), "");
}

TEST_F(WatchChanges, AKilledWatchRegistersOnceMoreAndNotTwice) {
  room_.runner.length = 600s;
  revise_plan();
  room_.pass(30s);
  ASSERT_THAT(room_.runs(), SizeIs(2));
  room_.start();
  room_.runner.length = 0s;
  room_.pass(600s);
  EXPECT_THAT(sessions(), UnorderedElementsAre(session("P"), session("P") + "-2"));
  EXPECT_THAT(room_.runs(), SizeIs(3));
}

TEST_F(WatchChanges, APersonReleasesWhatWasRegisteredAgain) {
  allow_automatic_release();
  register_first("Q");
  ASSERT_TRUE(is_released("Q"));
  bring_late_slice("Q");
  room_.pass(600s);
  EXPECT_THAT(room_.index(), HasSubstr("held for a person: its X-rays were registered before, from other files"));
  EXPECT_FALSE(ResultsTree(room_.file.results).is_released(session("Q") + "-2"));
}

// The X-rays name no plan, and a second one comes: which is meant, nothing tells.
TEST_F(WatchChanges, FilesThatMakeItUnclearWhatIsMeantAreSaid) {
  make_plan_of_q_unclear();
  EXPECT_THAT(room_.runs(), SizeIs(2));
  EXPECT_THAT(room_.index(), HasSubstr("files came after the registration: "));
}

TEST_F(WatchChanges, AResultByHandIsNoWayAroundWhatSpeaksAgainstTheOneBefore) {
  make_plan_of_q_unclear();
  hand_over("Q");
  room_.pass(1s);
  const std::string by_hand = session("Q") + "-2";
  ASSERT_THAT(sessions(), testing::Contains(by_hand));
  EXPECT_THAT(objection(by_hand), HasSubstr("files came after the registration: "));
  room_.start();
  hand_over("Q");
  room_.pass(1s);
  EXPECT_THAT(objection(session("Q") + "-3"), HasSubstr("files came after the registration: ")) << "after a restart";
}

TEST_F(WatchChanges, AResultByHandFromEarlierFilesIsObjectedToAndTheXraysAreRegisteredAgain) {
  hand_over("P");  // which the engine takes over when it has begun to register again
  room_.runner.length = 30s;
  revise_plan();
  room_.watch.reset();
  room_.start();
  room_.pass(60s);
  const std::string by_hand = session("P") + "-2";
  EXPECT_THAT(objection(by_hand), HasSubstr("RT Plan changed after the registration"));
  room_.pass(120s);
  EXPECT_THAT(sessions(), testing::Contains(session("P") + "-3"));
  EXPECT_EQ(objection(session("P") + "-3"), "");
}

TEST_F(WatchChanges, WhatIsTakenOverDuringARegistrationOfOtherFilesIsObjectedToAtOnce) {
  room_.runner.length = 600s;
  revise_plan();
  room_.pass(30s);
  ASSERT_TRUE(room_.runner.is_running());
  hand_over("P");
  room_.pass(1s);
  EXPECT_THAT(objection(session("P") + "-2"), HasSubstr("made by hand from files that are others now"));
  room_.pass(1300s, 10s);
  EXPECT_THAT(sessions(), testing::Contains(session("P") + "-3"));
  EXPECT_EQ(objection(session("P") + "-3"), "");
}

// Sent again with the right patient's ID.
TEST_F(WatchChanges, XraysThatBelongToAnotherPatientNowAreRegisteredForThatPatient) {
  for (const auto& [uid, label, second] : {std::tuple("P1", "AP", 0), std::tuple("P2", "LAT", 10)}) {
    const StudyFiles of_q = xray("Q", uid, label, second_of(10, 15, second));
    room_.source.give_away("P", uid);
    room_.contents.written[of_q.images[0].file] = "of Q";
    room_.source.bring(of_q);
  }
  room_.pass(60s);
  EXPECT_THAT(objection(session("P")), HasSubstr("X-rays of it belong to patient Q now"));
  EXPECT_THAT(room_.index(), HasSubstr("waits for"));
  room_.source.bring(ct_of("Q"));
  room_.source.bring(plan_of("Q"));
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(2));
  EXPECT_THAT(error_of_release("P"), HasSubstr("have a newer result"));
}

TEST_F(WatchChanges, APlanThatBelongsToAnotherPatientNowSpeaksAgainstResults) {
  StudyFiles moved = plan_of("Q");
  moved.plans[0].sop_instance_uid = plan_of("P").plans[0].sop_instance_uid;
  room_.source.give_away("P", moved.plans[0].sop_instance_uid);
  room_.source.bring(moved);
  room_.pass(60s);
  EXPECT_THAT(objection(session("P")), HasSubstr("its RT Plan belongs to patient Q now"));
}

}  // namespace
}  // namespace isoshift::watch_changes_test
