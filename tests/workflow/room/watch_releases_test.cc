#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "base/error.h"
#include "base/output_folder.h"
#include "io/study/session_files.h"
#include "tests/support/treatment_room.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/watch.h"

namespace isoshift {
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

// Sessions of patients, each with the X-rays PATIENT1 and PATIENT2.
class WatchReleases : public testing::Test {
 protected:
  void allow_automatic_release() { room_.file.site.automatic_release = {.by = "J. Doe", .on = "2026-03-01"}; }
  void bring(const std::string& patient) {
    room_.source.bring(ct_of(patient));
    room_.source.bring(plan_of(patient));
    room_.source.bring(xray(patient, patient + "1", "AP", second_of(10, 15)));
    room_.source.bring(xray(patient, patient + "2", "LAT", second_of(10, 15, 10)));
  }
  static std::string session(const std::string& patient) { return session_name({patient + "1", patient + "2"}); }
  void release(const std::string& patient) {
    ResultsTree(room_.file.results)
        .release(session(patient), {.by = "J. Doe", .user = "isoshift", .sudo_user = ""}, room_.file.names_of_peers());
  }
  std::string error_of_release(const std::string& patient) {
    try {
      release(patient);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::string audit() const {
    std::ifstream file(room_.file.results / "audit.jsonl");
    return {std::istreambuf_iterator<char>(file), {}};
  }
  bool is_released(const std::string& patient) const {
    return ResultsTree(room_.file.results).is_released(session(patient));
  }
  auto objects(const std::string& peer, const std::string& patient) const {
    const std::string key = fmt::format("{} {}/", peer, session(patient));
    return std::pair(Pair(key + "spatial_registration.dcm", 1), Pair(key + "report.dcm", 1));
  }
  // When a peer was tried, after the first time.
  std::vector<std::chrono::seconds> attempts(const std::string& peer) const {
    std::vector<Clock::Time> times;
    for (const FakeSender::Attempt& attempt : room_.sender.attempts())
      if (attempt.peer == peer) times.push_back(attempt.at);
    std::vector<std::chrono::seconds> after;
    for (const Clock::Time time : times)
      after.push_back(std::chrono::duration_cast<std::chrono::seconds>(time - times.front()));
    return after;
  }

  TreatmentRoom room_;
};

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
  room_.start();
  bring("P");
  room_.pass(60s);
  room_.source.bring(xray("P", "P3", "AP", second_of(10, 15, 5)));
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
  room_.start();
  bring("P");
  room_.pass(60s);
  room_.source.bring(xray("P", "P3", "AP", second_of(10, 20)));
  room_.source.bring(xray("P", "P4", "LAT", second_of(10, 20, 10)));
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(2));
  release("P");
  EXPECT_EQ(ResultsTree(room_.file.results).release_of(session("P"))->despite,
            "the patient has newer X-rays: LAT 2026-03-02 10:20:10");
}

TEST_F(WatchReleases, AnObjectionReachesTheDiskWhateverItHoldsAndHoweverLate) {
  room_.start();
  bring("P");
  room_.pass(60s);
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
  EXPECT_THAT(error_of_release("P"), HasSubstr("the patient has newer X-rays: Sch"));
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
  room_.start();
  bring("P");
  room_.pass(60s);
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
  room_.source.broken = {"/in/P3: cannot be read"};
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

// A watch that began while result.json said something else must not remember it.
TEST_F(WatchReleases, AVerdictThatWasExchangedForAWhileReleasesNothing) {
  allow_automatic_release();
  room_.runner.verdict = [](const auto&) { return Verdict::kReview; };
  room_.start();
  bring("P");
  room_.pass(60s);
  const fs::path result = room_.file.results / "sessions" / session("P") / "result.json";
  std::string text;
  std::getline(std::ifstream(result), text, '\0');
  std::string exchanged = text;
  exchanged.replace(exchanged.find("\"review\""), 8, "\"accepted\"");
  replace_text(result, exchanged);
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
  room_.start();
  bring("P");
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  EXPECT_FALSE(is_released("P"));
  room_.start();
  room_.pass(60s);
  EXPECT_FALSE(is_released("P"));
  EXPECT_THAT(room_.sender.attempts(), IsEmpty());
}

TEST_F(WatchReleases, WithoutTheSitesRuleAcceptedResultsAreHeld) {
  room_.start();
  bring("P");
  room_.pass(60s);
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
  room_.start();
  bring("P");
  room_.pass(60s);
  room_.sender.down = {"record", "archive"};
  release("P");
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
}  // namespace isoshift
