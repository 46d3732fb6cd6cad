// What other X-rays hold back between a release and its sending.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/output_folder.h"
#include "tests/support/watch_releases.h"

namespace isoshift::watch_sending_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

class WatchSending : public WatchReleases {
 protected:
  void bring_verification() {
    room_.source.bring(xray("P", "P4", "AP", second_of(10, 20)));
    room_.source.bring(xray("P", "P5", "LAT", second_of(10, 20, 10)));
    room_.pass(60s);
  }
};

// In the first round of a new run, a file may be there that was not seen yet.
TEST_F(WatchSending, NothingIsSentBeforeTheSourceHasBeenComparedWithTheResults) {
  release_while_peers_are_down();
  bring_one_between("P");
  room_.start();
  room_.sender.down.clear();
  room_.watch->deliver({});
  EXPECT_THAT(room_.sender.stored(), IsEmpty());
  room_.pass(600s);
  EXPECT_THAT(room_.sender.stored(), IsEmpty());
  EXPECT_THAT(room_.sending.lines, Contains(HasSubstr("since its release, together with X-rays that")));
}

TEST_F(WatchSending, NothingIsSentWhileAnXrayMayBeOnItsWay) {
  release_while_peers_are_down();
  room_.sender.down.clear();
  room_.source.set_coming(true);
  room_.pass(600s);
  EXPECT_THAT(room_.sender.stored(), IsEmpty());
  room_.source.set_coming(false);
  room_.source.set_down(true);
  room_.pass(600s);
  EXPECT_THAT(room_.sender.stored(), IsEmpty());
  room_.source.set_down(false);
  room_.pass(600s);
  EXPECT_THAT(room_.sender.stored(), SizeIs(4));
}

// Whatever becomes of the newer result: it may have no registration object, or not be sent.
TEST_F(WatchSending, AnOlderResultIsNotSentOnceThereIsANewer) {
  release_while_peers_are_down();
  bring_verification();
  ASSERT_THAT(room_.runs(), SizeIs(2));
  const std::string newer = session_name({"P4", "P5"});
  ResultsTree(room_.file.results).release(newer, {.by = "J. Doe", .user = "u"}, room_.file.names_of_peers());
  room_.sender.down.clear();
  room_.pass(600s);
  EXPECT_THAT(room_.sending.lines, Contains(HasSubstr("since its release, the patient has newer X-rays: LAT")));
  EXPECT_THAT(room_.sender.stored(), SizeIs(4));
  for (const auto& [object, times] : room_.sender.stored()) EXPECT_THAT(object, HasSubstr(newer));
}

// A person knew of the verification, not of what was taken after it.
TEST_F(WatchSending, AReleaseDespiteOtherXraysIsForThose) {
  register_first("P");
  bring_verification();
  room_.sender.down = {"record", "archive"};
  release("P");
  room_.source.bring(xray("P", "P6", "AP", second_of(10, 40)));
  room_.pass(60s);
  room_.sender.down.clear();
  room_.pass(600s);
  EXPECT_THAT(room_.sender.stored(), IsEmpty());
  EXPECT_THAT(room_.sending.lines, Contains(HasSubstr("since its release, the patient has newer X-rays: AP")));
}

TEST_F(WatchSending, AnObjectionIsInTheAuditLogToo) {
  register_first("P");
  bring_one_between("P");
  room_.pass(60s);
  EXPECT_THAT(audit(), HasSubstr(R"("event":"objection")"));
  const fs::path kept = room_.file.results / "objections.json";
  const std::string words = error_of_release("P");
  EXPECT_THAT(words, HasSubstr("grouped in another way"));
  for (const char* text : {"{}", ""}) {
    fs::remove(kept);
    if (*text != '\0') write_text(kept, text);
    EXPECT_THAT(error_of_release("P"), HasSubstr("audit.jsonl tells of an objection to it that objections.json does"));
  }
  EXPECT_FALSE(is_released("P"));
}

// The log cannot be written when the objection is found.
TEST_F(WatchSending, AnObjectionWaitsForItsLineInTheAuditLog) {
  register_first("P");
  const fs::path log = room_.file.results / "audit.jsonl", aside = room_.folder / "audit.jsonl";
  fs::rename(log, aside);
  fs::create_directory(log);
  bring_one_between("P");
  room_.pass(5s);
  EXPECT_FALSE(fs::exists(room_.file.results / "objections.json"));
  fs::remove(log);
  fs::rename(aside, log);
  room_.start();
  room_.pass(5s);
  EXPECT_THAT(audit(), HasSubstr(R"("event":"objection")"));
  EXPECT_TRUE(fs::exists(room_.file.results / "objections.json"));
}

// The clock of the second imager was not put back to winter time, but its offset from UTC was.
TEST_F(WatchSending, XraysWhoseClockAndOffsetContradictEachOtherMayBeNewer) {
  allow_automatic_release();
  room_.runner.length = 20s;
  room_.start();
  for (const StudyFiles& files : {ct_of("P"), plan_of("P")}) room_.source.bring(files);
  for (const auto& [uid, label, second] : {std::tuple("P1", "AP", 0), std::tuple("P2", "LAT", 10)}) {
    StudyFiles files = xray("P", uid, label, second_of(10, 15, second));
    files.images.front().has_utc_offset = true;
    room_.source.bring(files);
  }
  room_.pass(15s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  StudyFiles newer = xray("P", "P3", "AP", second_of(10, 18));
  newer.images.front().has_utc_offset = true;
  *newer.images.front().at_s -= 3600.0;
  room_.source.bring(newer);
  room_.pass(120s);
  EXPECT_FALSE(is_released("P"));
}

}  // namespace
}  // namespace isoshift::watch_sending_test
