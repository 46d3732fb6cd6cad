#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "base/output_folder.h"
#include "base/sha256.h"
#include "tests/support/watch_releases.h"

namespace isoshift::watch_releases_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::Pair;
using testing::SizeIs;
using testing::UnorderedElementsAre;

// A person at the screen (isoshift room serve) made another result of the X-rays, from a copy of the one there was.
TEST_F(WatchReleases, AResultByHandIsTakenOverAndSupersedesTheOneBefore) {
  allow_automatic_release();
  register_first("P");
  ASSERT_TRUE(is_released("P"));
  ResultsTree tree(room_.file.results);
  EXPECT_FALSE(tree.order(session("P")).parts.images.empty()) << "what to begin with is not known";
  const fs::path by_hand = room_.file.results / "by_hand" / session("P") / "1";
  fs::create_directories(by_hand.parent_path());
  fs::copy(tree.session(session("P")), by_hand);
  replace_text(by_hand / "report.dcm", "report of what was found by hand");
  replace_text(by_hand / "spatial_registration.dcm", "registration by hand");
  const std::string further =
      tree.hand_over(tree.manual_basis(session("P")), {.folder = by_hand, .files = sha256_of_folder(by_hand)}, "jdoe");
  room_.start();  // the watch before was killed meanwhile
  room_.pass(2s);
  EXPECT_THAT(ResultsTree(room_.file.results).sessions(), UnorderedElementsAre(session("P"), further));
  EXPECT_THAT(room_.index(), HasSubstr("superseded by session " + further));
  EXPECT_THAT(room_.index(), HasSubstr("held for a person: a person has made it by hand"));
  EXPECT_FALSE(ResultsTree(room_.file.results).is_released(further));
}

TEST_F(WatchReleases, NothingIsSentBeforeAPersonReleasesIt) {
  room_.start();
  bring("P");
  room_.pass(3600s, 10s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  EXPECT_THAT(room_.sender.attempts(), IsEmpty());
  EXPECT_THAT(room_.index(), HasSubstr("<td>held</td>"));
  release("P");
  room_.pass(10s);
  const auto [record1, record2] = objects("record", "P");
  const auto [archive1, archive2] = objects("archive", "P");
  EXPECT_THAT(room_.sender.stored(), UnorderedElementsAre(record1, record2, archive1, archive2));
  room_.pass(3600s, 10s);
  EXPECT_THAT(room_.sender.attempts(), SizeIs(4));
  EXPECT_THAT(room_.index(), HasSubstr("; sent</td>"));
}

TEST_F(WatchReleases, OnlyAcceptedResultsAreReleasedWithoutAPerson) {
  allow_automatic_release();
  room_.runner.verdict = [](const std::set<std::string>& xrays) {
    return xrays.contains("P1") ? Verdict::kAccepted : xrays.contains("Q1") ? Verdict::kReview : Verdict::kRejected;
  };
  room_.start();
  for (const char* patient : {"P", "Q", "R"}) bring(patient);
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(3));
  EXPECT_TRUE(is_released("P"));
  EXPECT_FALSE(is_released("Q"));
  EXPECT_FALSE(is_released("R"));
  for (const FakeSender::Attempt& attempt : room_.sender.attempts())
    EXPECT_THAT(attempt.object, HasSubstr(session("P") + "/"));
  EXPECT_THAT(room_.sender.stored(), SizeIs(4));
  EXPECT_THAT(room_.index(), HasSubstr("released by automatic, allowed by J. Doe on 2026-03-01"));
}

// A watch that began while result.json said something else must not remember it.
TEST_F(WatchReleases, AVerdictThatWasExchangedForAWhileReleasesNothing) {
  allow_automatic_release();
  room_.runner.verdict = [](const auto&) { return Verdict::kReview; };
  register_first("P");
  const fs::path result = room_.file.results / "sessions" / session("P") / "result.json";
  std::string text;
  std::getline(std::ifstream(result), text, '\0');
  auto exchanged = nlohmann::ordered_json::parse(text);
  exchanged["verdict"] = "accepted";
  exchanged["reasons"] = exchanged["findings"] = nlohmann::ordered_json::array();
  replace_text(result, exchanged.dump(2));
  room_.start();
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("the result was changed"));
  replace_text(result, text);
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  EXPECT_THAT(room_.sender.attempts(), IsEmpty());
}

TEST_F(WatchReleases, WhatWasMadeUnderAnotherSiteFileWaitsForAPerson) {
  allow_automatic_release();
  room_.runner.site_sha256 = "an earlier site file";
  register_first("P");
  ASSERT_THAT(room_.runs(), SizeIs(1));
  EXPECT_FALSE(is_released("P"));
  room_.start();
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  EXPECT_THAT(room_.sender.attempts(), IsEmpty());
}

TEST_F(WatchReleases, WithoutTheSitesRuleAcceptedResultsAreHeld) {
  register_first("P");
  ASSERT_THAT(room_.runs(), SizeIs(1));
  // The rule comes later, with another site file.
  room_.file.site.sha256 = "another site file";
  allow_automatic_release();
  room_.start();
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
}

TEST_F(WatchReleases, AReleaseThatFailsBlocksNoOther) {
  allow_automatic_release();
  room_.start();
  bring("P");
  room_.pass(11s);
  const fs::path held = room_.file.results / "released" / ("." + session("P") + ".json");
  fs::create_directory(held);  // where the release is written first
  write_text(held / "x", "");
  bring("Q");
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  EXPECT_TRUE(is_released("Q"));
  EXPECT_THAT(room_.index(), HasSubstr("Trouble: releasing: "));
  fs::remove_all(held);
  room_.pass(5s);
  EXPECT_TRUE(is_released("P"));
  EXPECT_THAT(room_.index(), Not(HasSubstr("Trouble: releasing: ")));
}

TEST_F(WatchReleases, APeerThatIsDownIsTriedAgainAndKeepsNoOtherWaiting) {
  room_.start();
  bring("P");
  room_.pass(30s);
  room_.sender.down = {"record"};
  release("P");
  room_.pass(1s);
  EXPECT_THAT(attempts("archive"), ElementsAre(0s, 0s)) << "held up by the peer that is down";
  room_.pass(1200s);
  EXPECT_THAT(attempts("record"), ElementsAre(0s, 2s, 6s, 14s, 30s, 62s, 126s, 254s, 510s, 810s, 1110s));
  EXPECT_THAT(attempts("archive"), SizeIs(2));
  EXPECT_THAT(room_.sending.lines, Contains(HasSubstr("tried again in 300 s: peer record: no answer")));
  room_.sender.down.clear();
  room_.pass(300s);
  EXPECT_THAT(room_.sender.stored(), SizeIs(4));
}

TEST_F(WatchReleases, AnObjectWhoseAnswerWasLostIsAskedForBeforeItIsSentAgain) {
  room_.start();
  bring("P");
  room_.pass(30s);
  int answers_to_lose = 2;
  room_.sender.loses_answer = [&] { return answers_to_lose-- > 0; };
  release("P");
  room_.pass(2s);
  room_.start();
  room_.pass(60s);
  EXPECT_THAT(room_.sender.stored(), SizeIs(4));
  for (const auto& [object, times] : room_.sender.stored()) EXPECT_EQ(times, 1) << object;
  EXPECT_THAT(room_.sending.lines, Contains(HasSubstr("sent to record: was there")));
}

TEST_F(WatchReleases, ForgedAndExchangedResultsAreNotSentAndSaidOnce) {
  room_.start();
  bring("P");
  bring("Q");
  room_.pass(60s);
  room_.sender.down = {"record", "archive"};
  release("P");
  replace_text(room_.file.results / "sessions" / session("P") / "report.dcm", "another report");
  write_text(room_.file.results / "released" / (session("Q") + ".json"), R"({"schema": 1})");
  room_.sender.down.clear();
  room_.pass(3600s, 10s);
  EXPECT_THAT(room_.sender.attempts(), IsEmpty());
  for (const char* patient : {"P", "Q"})
    EXPECT_EQ(std::ranges::count_if(room_.sending.lines,
                                    [&](const auto& line) {
                                      return line.starts_with("warning: session " + session(patient) + ": not sent");
                                    }),
              1)
        << patient;
  EXPECT_THAT(room_.index(), HasSubstr("is not the newest release of session"));
}

TEST_F(WatchReleases, ASessionThatIsRegisteredAgainNeedsAReleaseOfItsOwn) {
  release_while_peers_are_down();
  fs::rename(room_.file.results / "sessions" / session("P"), room_.folder / "aside");
  room_.sender.down.clear();
  room_.runner.verdict = [](const auto&) { return Verdict::kReview; };
  room_.start();
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(2));
  EXPECT_THAT(room_.sender.attempts(), IsEmpty());
  EXPECT_THAT(room_.index(), HasSubstr("releases an earlier registration"));
  fs::remove(room_.file.results / "released" / (session("P") + ".json"));
  release("P");
  room_.pass(300s);
  EXPECT_THAT(room_.sender.stored(), UnorderedElementsAre(Pair("record " + session("P") + "/report.dcm", 1),
                                                          Pair("archive " + session("P") + "/report.dcm", 1)));
}

}  // namespace
}  // namespace isoshift::watch_releases_test
