// Results that a registration did not leave like this: nothing of them is sent.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/report/result_folder.h"
#include "tests/support/command.h"
#include "tests/support/watch_releases.h"

namespace isoshift::watch_forgeries_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::AnyOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// With the key of a watch file, and without.
class WatchForgeries : public WatchReleases, public testing::WithParamInterface<bool> {
 protected:
  WatchForgeries() {
    if (GetParam()) {
      const CommandOutcome made =
          run_shell("openssl genpkey -algorithm ed25519 -out " + key_.string() + " 2>&1 && chmod 600 " + key_.string());
      EXPECT_EQ(made.exit_status, 0) << made.out;
      room_.file.signing_key = key_;
    }
    room_.runner.verdict = [](const auto&) { return Verdict::kReview; };
    register_first("P");
  }
  ResultsTree tree() const { return ResultsTree(room_.file); }
  // A copy of P's result at another place.
  MadeResult copy(const fs::path& to) const {
    fs::create_directories(to.parent_path());
    fs::copy(tree().session(session("P")), to);
    return {.folder = to, .files = sha256_of_folder(to)};
  }
  static void edit_verdict(const fs::path& folder) {
    nlohmann::json result = nlohmann::json::parse(std::ifstream(folder / kResultFile));
    ASSERT_EQ(result.at("verdict"), "review");
    result["verdict"] = "accepted";
    replace_text(folder / kResultFile, result.dump());
    replace_text(folder / kRegistrationFile, "a registration that nobody made");
  }
  fs::path waiting() const { return room_.file.results / "handed_over" / session("P"); }
  std::string error_of_hand_over(const MadeResult& result) const {
    ResultsTree tree = this->tree();
    try {
      tree.hand_over(tree.manual_basis(session("P")), result, "jdoe");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  // Releases whatever there is of P, and looks at what leaves.
  void expect_nothing_sent() {
    room_.pass(30s);
    for (const std::string& name : tree().sessions()) {
      try {
        tree().release(name, {.by = "J. Doe", .user = "isoshift", .sudo_user = ""}, room_.file.names_of_peers());
      } catch (const Error& refused) {
        RecordProperty(name, refused.what());
      }
    }
    room_.pass(600s, 10s);
    EXPECT_THAT(room_.sender.attempts(), IsEmpty());
    EXPECT_THAT(tree().sessions(), ElementsAre(session("P")));
  }

  const fs::path key_ = room_.folder / "release.key", by_hand_ = room_.folder / "by_hand" / "2";
};

TEST_P(WatchForgeries, AFolderThatNobodyHasHandedOverIsNotTakenOver) {
  copy(waiting());
  edit_verdict(waiting());
  expect_nothing_sent();
  EXPECT_THAT(room_.observer.lines, Contains(HasSubstr("nobody has handed it over")));
}

TEST_P(WatchForgeries, AResultThatWasEditedAfterItsRegistrationIsNotHandedOver) {
  const MadeResult made = copy(by_hand_);
  edit_verdict(by_hand_);
  EXPECT_THAT(error_of_hand_over(made), AnyOf(HasSubstr("is not what was registered"), HasSubstr("was added")));
  EXPECT_THAT(audit(), testing::Not(HasSubstr("handed over")));
  EXPECT_FALSE(fs::exists(waiting()));
}

TEST_P(WatchForgeries, AResultThatWasEditedAfterItWasHandedOverIsNotTakenOver) {
  ASSERT_EQ(error_of_hand_over(copy(by_hand_)), "");
  edit_verdict(waiting());
  expect_nothing_sent();
  EXPECT_THAT(room_.observer.lines,
              Contains(testing::AllOf(HasSubstr("result.json: is not what was registered"),
                                      HasSubstr("until a person moves the folder in handed_over away"))));
}

TEST_P(WatchForgeries, AnotherResultInThePlaceOfWhatWasHandedOverIsNotTakenOver) {
  ASSERT_EQ(error_of_hand_over(copy(by_hand_)), "");
  fs::remove_all(waiting());
  copy(waiting());
  edit_verdict(waiting());
  nlohmann::json statement = nlohmann::json::parse(std::ifstream(waiting().string() + ".1.json"));
  statement["files"] = sha256_of_folder(waiting());
  replace_text(waiting().string() + ".1.json", statement.dump());
  expect_nothing_sent();
  EXPECT_THAT(room_.observer.lines, Contains(HasSubstr("is not the newest result by hand about the session")));
}

TEST_P(WatchForgeries, WhatWasHandedOverIsTakenOverOnce) {
  ASSERT_EQ(error_of_hand_over(copy(by_hand_)), "");
  const fs::path kept = room_.folder / "kept";
  fs::copy(waiting(), kept);
  room_.pass(5s);
  ASSERT_THAT(tree().sessions(), ElementsAre(session("P"), session("P") + "-2"));
  fs::copy(kept, waiting());
  room_.pass(5s);
  EXPECT_THAT(tree().sessions(), SizeIs(2));
  EXPECT_THAT(room_.observer.lines, Contains(HasSubstr("is session " + session("P") + "-2 already")));
  fs::remove_all(waiting());
  EXPECT_EQ(error_of_hand_over(copy(by_hand_)), "") << "the next one";
  room_.pass(5s);
  EXPECT_THAT(tree().sessions(), SizeIs(3));
}

TEST_P(WatchForgeries, AResultThatWasEditedBeforeItsRegistrationIsRecordedIsNotPublished) {
  room_.runner.after_end = edit_verdict;
  bring("Q");
  room_.pass(600s, 10s);
  EXPECT_THAT(tree().sessions(), ElementsAre(session("P")));
  EXPECT_NE(error_of_release("Q"), "");
  EXPECT_THAT(room_.sender.attempts(), IsEmpty());
  EXPECT_THAT(room_.observer.lines, Contains(HasSubstr("result.json: is not what was registered")));
}

// By who can write the log, and has no key.
TEST_P(WatchForgeries, ALineInTheLogIsNotEnoughWhereThereIsAKey) {
  if (!GetParam()) GTEST_SKIP() << "nothing tells it from a genuine one";
  copy(waiting());
  edit_verdict(waiting());
  const nlohmann::json forged = {
      {"schema", 1}, {"session", session("P")}, {"files", sha256_of_folder(waiting())}, {"inputs", nullptr}};
  replace_text(waiting().string() + ".1.json", forged.dump());
  AuditLog(room_.file.results / "audit.jsonl")
      .append("handed over", {{"session", session("P")}, {"file", sha256_of(forged.dump())}});
  expect_nothing_sent();
  EXPECT_THAT(room_.observer.lines, Contains(HasSubstr("is not signed by the signing_key")));
}

// Whoever sends asks for the signature, too.
TEST_P(WatchForgeries, AReleaseThatTheKeyHasNotSignedIsNotSent) {
  release("P");  // without the key
  room_.pass(600s, 10s);
  EXPECT_EQ(room_.sender.attempts().empty(), GetParam());
  EXPECT_EQ(
      std::ranges::count_if(room_.sending.lines,
                            [](const std::string& line) { return line.find("is not signed by the") != line.npos; }),
      GetParam() ? 1 : 0);
}

INSTANTIATE_TEST_SUITE_P(Keys, WatchForgeries, testing::Bool(),
                         [](const auto& one) { return one.param ? "WithKey" : "WithoutKey"; });

}  // namespace
}  // namespace isoshift::watch_forgeries_test
