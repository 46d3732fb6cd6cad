// What changes after a registration: late slices, another plan.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/watch_releases.h"

namespace isoshift {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;
using testing::UnorderedElementsAre;

class WatchChanges : public WatchReleases {
 protected:
  WatchChanges() {
    room_.start();
    bring("P");
    room_.pass(60s);
  }
  void bring_late_slice() {
    StudyFiles late = ct_of("P");
    late.cts[0].files = {"/in/late"};
    late.cts[0].sop_instance_uids = {"late"};
    room_.source.bring(late);
  }
  void revise_plan() {
    room_.contents.written["/in/plan.P"] = "revised";
    room_.source.bring(plan_of("P"));
  }
  std::vector<std::string> sessions() const { return ResultsTree(room_.file.results).sessions(); }
};

TEST_F(WatchChanges, LateSlicesAndARevisedPlanSupersedeAResult) {
  ASSERT_THAT(room_.runs(), SizeIs(1));
  bring_late_slice();
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
  room_.start();
  bring("Q");
  room_.pass(60s);
  ASSERT_TRUE(is_released("Q"));
  StudyFiles late = ct_of("Q");
  late.cts[0].files = {"/in/late"};
  late.cts[0].sop_instance_uids = {"late"};
  room_.source.bring(late);
  room_.pass(600s);
  EXPECT_THAT(room_.index(), HasSubstr("held for a person: its X-rays were registered before, from other files"));
  EXPECT_FALSE(ResultsTree(room_.file.results).is_released(session("Q") + "-2"));
}

// The X-rays name no plan, and a second one comes: which is meant, nothing tells.
TEST_F(WatchChanges, FilesThatMakeItUnclearWhatIsMeantAreSaid) {
  for (StudyFiles image : {xray("Q", "Q1", "AP", second_of(11, 15)), xray("Q", "Q2", "LAT", second_of(11, 15, 10))}) {
    image.images[0].plan_uid = "";
    room_.source.bring(image);
  }
  room_.source.bring(ct_of("Q"));
  room_.source.bring(plan_of("Q"));
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(2));
  StudyFiles second = plan_of("Q");
  second.plans[0].file = "/in/second";
  second.plans[0].sop_instance_uid = "second";
  room_.source.bring(second);
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(2));
  EXPECT_THAT(room_.index(), HasSubstr("files came after the registration: "));
}

}  // namespace
}  // namespace isoshift
