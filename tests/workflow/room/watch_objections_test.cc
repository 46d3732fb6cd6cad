// Other X-rays of a patient speak against a result.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/output_folder.h"
#include "tests/support/watch_releases.h"

namespace isoshift::watch_objections_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::SizeIs;

// LAT is taken again while the pair is registered, or the newer of two sessions that wait is registered first: the
// couch may have moved since the older X-rays.
TEST_F(WatchReleases, WhatIsOlderThanOtherXraysOfThePatientWaitsForAPerson) {
  allow_automatic_release();
  room_.runner.length = 20s;
  room_.start();
  bring("P");
  bring("Q");
  room_.pass(15s);
  room_.source.bring(xray("P", "P3", "LAT", second_of(10, 16)));
  room_.source.bring(xray("Q", "Q3", "AP", second_of(10, 20)));
  room_.source.bring(xray("Q", "Q4", "LAT", second_of(10, 20, 10)));
  room_.pass(120s);
  EXPECT_THAT(room_.runs(), SizeIs(3));
  EXPECT_FALSE(is_released("P"));
  EXPECT_FALSE(is_released("Q"));
  EXPECT_TRUE(ResultsTree(room_.file.results).is_released(session_name({"Q3", "Q4"})));
  EXPECT_THAT(room_.index(), HasSubstr("held; the patient has newer X-rays: LAT 2026-03-02 10:16:00"));
  EXPECT_THAT(room_.index(), HasSubstr("held; the patient has newer X-rays: LAT 2026-03-02 10:20:10"));
  room_.start();
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  EXPECT_FALSE(is_released("Q"));
}

// A person is told, and has to say so.
TEST_F(WatchReleases, OtherXraysThatSpeakAgainstAResultAreSaidInItsRelease) {
  register_first("P");
  bring_one_between("P");
  room_.pass(60s);
  EXPECT_THAT(room_.index(),
              HasSubstr("held; together with X-rays that have come later, these would be grouped in another way"));
  room_.start();  // what was known is remembered
  room_.pass(60s);
  EXPECT_THAT(error_of_release("P"),
              AllOf(HasSubstr("together with X-rays that have come later, these would be grouped in another way"),
                    HasSubstr("--despite-other-xrays")));
  EXPECT_FALSE(is_released("P"));
  ResultsTree tree(room_.file.results);
  const Release release =
      tree.release(session("P"), {.by = "J. Doe", .user = "u", .despite_objection = true}, {"record"});
  EXPECT_EQ(release.despite, "together with X-rays that have come later, these would be grouped in another way");
  EXPECT_EQ(tree.release_of(session("P"))->despite, release.despite);
  room_.pass(1s);
  EXPECT_THAT(room_.index(),
              HasSubstr(", although together with X-rays that have come later, these would be grouped in another way"));
  EXPECT_THAT(audit(), AllOf(HasSubstr("\"despite_other_xrays\":true"), Not(HasSubstr("have come later"))));
}

// A verification after the couch has moved is everyday work.
TEST_F(WatchReleases, APersonReleasesWhatIsOlderThanAnotherResultWithAWarning) {
  register_first("P");
  room_.source.bring(xray("P", "P3", "AP", second_of(10, 20)));
  room_.source.bring(xray("P", "P4", "LAT", second_of(10, 20, 10)));
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(2));
  release("P");
  EXPECT_EQ(ResultsTree(room_.file.results).release_of(session("P"))->despite,
            "the patient has newer X-rays: LAT 2026-03-02 10:20:10");
}

TEST_F(WatchReleases, AnObjectionReachesTheDiskWhateverItHoldsAndHoweverLate) {
  register_first("P");
  const fs::path kept = room_.file.results / "objections.json";
  fs::create_directory(kept);  // cannot be replaced
  write_text(kept / "x", "");
  room_.source.bring(xray("P", "P3",
                          "Sch\xE4"
                          "del",
                          second_of(10, 20)));  // not UTF-8
  room_.pass(5s);
  EXPECT_THAT(room_.index(), HasSubstr("Trouble: comparing X-rays with results: "));
  fs::remove_all(kept);
  room_.pass(5s);
  EXPECT_THAT(error_of_release("P"),
              AllOf(HasSubstr("the patient has newer X-rays: Sch"), Not(HasSubstr("audit.jsonl tells"))));
}

TEST_F(WatchReleases, WhatIsSpokenAgainstBeforeItIsSentIsNotSent) {
  release_while_peers_are_down();
  room_.pass(5s);
  bring_one_between("P");
  room_.pass(5s);
  room_.sender.down.clear();
  room_.pass(600s);
  EXPECT_THAT(room_.sender.stored(), testing::IsEmpty());
  EXPECT_THAT(room_.sending.lines, testing::Contains(HasSubstr("since its release, together with X-rays that")));
}

// What speaks against a result is not forgotten for a newer result.
TEST_F(WatchReleases, AnObjectionIsNotWeakenedByXraysThatGo) {
  register_first("P");
  bring_one_between("P");
  room_.pass(60s);
  EXPECT_THAT(error_of_release("P"), HasSubstr("grouped in another way"));
  room_.source.lose("P", {"P1", "P2", "P3"});
  room_.source.bring(xray("P", "P4", "AP", second_of(10, 40)));
  room_.source.bring(xray("P", "P5", "LAT", second_of(10, 40, 10)));
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(2));
  EXPECT_THAT(error_of_release("P"), HasSubstr("grouped in another way"));
}

// X-rays after which the couch may have moved, in every form in which they came through once.
class WatchReleasesNothingOutdated : public WatchReleases, public testing::WithParamInterface<const char*> {
 protected:
  StudyFiles newer() const {
    StudyFiles files = ::isoshift::xray("P", "P3", "AP", second_of(10, 20));
    const std::string form = GetParam();
    StudyFiles::Image& image = files.images.front();
    if (form == "of another class") std::swap(files.images, files.other_xrays);
    if (form == "without a time") {
      image.at_s.reset();
      image.acquired.clear();
    }
    if (form == "of another time zone") {  // 09:20 there is 10:20 here
      image.has_utc_offset = true;
      image.acquired = "2026-03-02 09:20:00";
    }
    if (form == "of another plan") image.plan_uid = "other";
    return files;
  }
};

TEST_P(WatchReleasesNothingOutdated, WhileTheOlderOnesAreRegistered) {
  allow_automatic_release();
  room_.runner.length = 20s;
  room_.start();
  bring("P");
  room_.pass(15s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  room_.source.bring(newer());
  room_.pass(120s);
  EXPECT_FALSE(is_released("P"));
  EXPECT_THAT(room_.index(), HasSubstr("held; "));
}

INSTANTIATE_TEST_SUITE_P(Xrays, WatchReleasesNothingOutdated,
                         testing::Values("of its class", "of another class", "without a time", "of another time zone",
                                         "of another plan"));

TEST_F(WatchReleases, WhatAnEarlierRunRegisteredWaitsForAPerson) {
  register_first("P");
  ASSERT_THAT(room_.runs(), SizeIs(1));
  allow_automatic_release();
  room_.start();
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  EXPECT_THAT(room_.index(), HasSubstr("held for a person: an earlier run of watch registered it"));
}

TEST_F(WatchReleases, NothingIsReleasedByTheRuleWhileAnXrayMayBeOnItsWay) {
  allow_automatic_release();
  room_.runner.length = 20s;
  room_.start();
  bring("P");
  room_.pass(15s);
  room_.source.set_down(true);
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  room_.source.set_down(false);
  room_.source.set_coming(true);
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  room_.source.set_coming(false);
  room_.source.broken = {"/elsewhere/P3: cannot be read"};
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  room_.source.broken.clear();
  room_.pass(1s);
  EXPECT_TRUE(is_released("P"));
}

TEST_F(WatchReleases, XraysThatNameNoPlanWaitForAPerson) {
  allow_automatic_release();
  room_.start();
  room_.source.bring(ct_of("P"));
  room_.source.bring(plan_of("P"));
  for (const auto& [uid, label] : {std::pair("P1", "AP"), std::pair("P2", "LAT")}) {
    StudyFiles files = xray("P", uid, label, second_of(10, 15));
    files.images.front().plan_uid.clear();
    room_.source.bring(files);
  }
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  EXPECT_FALSE(is_released("P"));
}

// Whoever takes the last object for the valid one is right.
TEST_F(WatchReleases, APeerReceivesTheNewestReleaseLast) {
  room_.start();
  for (const char* patient : {"P", "Q", "R", "S"}) bring(patient);
  room_.pass(60s);
  room_.sender.down = {"record"};
  for (const char* patient : {"S", "P", "R", "Q"}) release(patient);
  room_.pass(30s);
  room_.sender.down.clear();
  const std::size_t before = room_.sender.attempts().size();
  room_.pass(600s);
  std::vector<std::string> sent;
  for (std::size_t n = before; n < room_.sender.attempts().size(); ++n)
    if (const std::string object = room_.sender.attempts()[n].object; object.ends_with("report.dcm"))
      sent.push_back(object.substr(0, object.find('/')));
  EXPECT_THAT(sent, ElementsAre(session("S"), session("P"), session("R"), session("Q")));
}

// That planning sends with a plan.
TEST_F(WatchReleases, ADrrIsNoXrayThatSpeaksAgainstAResult) {
  register_first("P");
  StudyFiles drr = xray("P", "drr", "RtImage_Bm1", second_of(11, 0));
  std::swap(drr.images, drr.drrs);
  room_.source.bring(drr);
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(1));
  EXPECT_EQ(objection(session("P")), "");
  EXPECT_THAT(room_.index(), HasSubstr("1 sessions registered, 0 waiting"));
}

}  // namespace
}  // namespace isoshift::watch_objections_test
