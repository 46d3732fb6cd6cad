// What people decide about results, further results of the same X-rays that they make by hand, and second persons.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output_folder.h"
#include "io/report/result_folder.h"
#include "tests/support/results_tree.h"

namespace isoshift::decisions_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class DecisionsTest : public ResultsTreeTest {
 protected:
  DecisionsTest() { tree_.keep_order(a_, {.parts = {.study = "/in"}}); }
  void decide(DecisionKind kind, const std::string& by = "jdoe", const std::string& reason = "Mrs Roe coughed") {
    tree_.decide({.kind = kind, .session = a_, .record = tree_.registered(a_).sha256, .reason = reason, .by = by});
  }
  fs::path decided(int number) const {
    return tree_.path() / "decided" / (a_ + "." + std::to_string(number) + ".json");
  }
  static MadeResult made(const fs::path& folder) { return {.folder = folder, .files = sha256_of_folder(folder)}; }
  // A result of the X-rays of a_ whose pose somebody has set by hand, finished and not handed over.
  MadeResult write_by_hand(const std::string& set_by = "jdoe", const std::string& verdict = "review") {
    write_registering(tree_, {"1.2.1", "1.2.2"}, verdict);
    const fs::path folder = tree_.registering(a_);
    nlohmann::json result = nlohmann::json::parse(text_of(folder / kResultFile));
    result["searched"] = false;
    result["start"] = {{"set_by", set_by}};
    replace_text(folder / kResultFile, result.dump());
    replace_text(folder / "report.dcm", "report of a pose set by " + set_by);
    return made(folder);
  }
  std::string by_hand(const std::string& set_by = "jdoe") {
    tree_.hand_over(tree_.manual_basis(a_), write_by_hand(set_by), set_by);
    return tree_.take_over(a_);
  }
  std::string error_of_release_by(const std::string& session, const std::string& by) {
    try {
      tree_.release(session, {.by = by, .user = "isoshift", .sudo_user = ""}, {"record"});
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
};

TEST_F(DecisionsTest, WhatWasRejectedIsNotReleasedUntilThatIsTakenBack) {
  for (const DecisionKind kind : {DecisionKind::kRejected, DecisionKind::kRepeat}) {
    decide(kind);
    EXPECT_THAT(error_of_release(a_), AllOf(HasSubstr("by jdoe on "), HasSubstr("Mrs Roe coughed")));
    EXPECT_THROW(decide(DecisionKind::kAgreed, "rroe"), Error);
  }
  decide(DecisionKind::kReopened, "rroe", "she did not");
  EXPECT_FALSE(tree_.decision(a_));
  EXPECT_EQ(error_of_release(a_), "");
}

TEST_F(DecisionsTest, WhatWasRejectedSinceItsReleaseIsNotSent) {
  tree_.release(a_, kDoe, {"record"});
  const std::vector<Delivery> pending = tree_.pending().deliveries;
  ASSERT_EQ(pending.size(), 2U);
  decide(DecisionKind::kRejected);
  EXPECT_THAT(error_of_sending(pending[0]), HasSubstr("rejected by jdoe on "));
  decide(DecisionKind::kReopened);
  EXPECT_EQ(error_of_sending(pending[0]), "");
}

TEST_F(DecisionsTest, TheAuditLogKnowsThemWithoutTheirReasons) {
  decide(DecisionKind::kRepeat);
  EXPECT_THAT(audit(), AllOf(HasSubstr(R"("event":"decided")"), HasSubstr(R"("decision":"repeat","by":"jdoe")"),
                             Not(HasSubstr("Roe"))));
}

TEST_F(DecisionsTest, WhatWasNotOnTheScreenIsNotDecidedAbout) {
  EXPECT_THROW(tree_.decide({.kind = DecisionKind::kAgreed, .session = a_, .record = "another", .by = "jdoe"}), Error);
  EXPECT_THROW(tree_.decide({.kind = DecisionKind::kAgreed, .session = "none", .record = "", .by = "jdoe"}), Error);
  EXPECT_FALSE(fs::exists(decided(1)));
}

TEST_F(DecisionsTest, AnEarlierResultsDecisionSaysNothingOfThePresentOne) {
  decide(DecisionKind::kRejected);
  fs::rename(tree_.session(a_), folder_ / "away");
  register_session(tree_, {"1.2.1", "1.2.2"}, "review");
  EXPECT_FALSE(tree_.decision(a_));
  EXPECT_EQ(error_of_release(a_), "");
}

TEST_F(DecisionsTest, AChangedDecisionStopsTheSessionUntilSomebodyDecidesAgain) {
  decide(DecisionKind::kRejected);
  replace_text(decided(1), text_of(decided(1)) + " ");
  EXPECT_THAT(error_of_release(a_), HasSubstr("is not the newest decision about the session in audit.jsonl"));
  fs::remove(decided(1));
  EXPECT_THAT(error_of_release(a_), HasSubstr("audit.jsonl tells of a decision that"));
  decide(DecisionKind::kReopened);
  EXPECT_EQ(error_of_release(a_), "");
}

TEST_F(DecisionsTest, ADecisionWithoutItsLineStopsTheSession) {
  write_text(decided(1), R"({"decision": "reopened", "session": ")" + a_ + "\"}");
  EXPECT_THAT(error_of_release(a_), HasSubstr("is not the newest decision about the session in audit.jsonl"));
}

TEST_F(DecisionsTest, NobodyReleasesAloneWhatTheySetByHand) {
  const std::string further = by_hand();
  EXPECT_EQ(further, a_ + "-2");
  EXPECT_THAT(error_of_release_by(further, "jdoe"), HasSubstr("another person must agree first, or release it"));
  tree_.decide({.kind = DecisionKind::kAgreed,
                .session = further,
                .record = tree_.registered(further).sha256,
                .by = "jdoe"});  // with themselves
  EXPECT_THAT(error_of_release_by(further, "jdoe"), HasSubstr("another person must agree first, or release it"));
  tree_.decide(
      {.kind = DecisionKind::kAgreed, .session = further, .record = tree_.registered(further).sha256, .by = "rroe"});
  EXPECT_EQ(error_of_release_by(further, "jdoe"), "");
}

TEST_F(DecisionsTest, AnotherPersonReleasesWhatWasSetByHand) { EXPECT_EQ(error_of_release_by(by_hand(), "rroe"), ""); }

TEST_F(DecisionsTest, TheWatchFileAsksForASecondPersonWhereAResultWasNotAccepted) {
  ResultsTree strict(WatchFile{.results = tree_.path(), .needs_second_person = true});
  const std::string review = register_session(tree_, {"1.2.9"}, "review");
  const Releaser doe{.by = "jdoe", .user = "isoshift", .sudo_user = ""};
  EXPECT_THROW(strict.release(review, doe, {"record"}), Error);
  const std::string record = strict.registered(review).sha256;
  strict.decide({.kind = DecisionKind::kAgreed, .session = review, .record = record, .by = "jdoe"});
  EXPECT_THROW(strict.release(review, doe, {"record"}), Error) << "agreed with themselves";
  strict.decide({.kind = DecisionKind::kAgreed, .session = review, .record = record, .by = "rroe"});
  EXPECT_NO_THROW(strict.release(review, doe, {"record"}));
  EXPECT_NO_THROW(strict.release(a_, doe, {"record"})) << "accepted";
}

TEST_F(DecisionsTest, AFurtherResultSupersedesTheOnesBefore) {
  tree_.release(a_, kDoe, {"record"});
  const std::vector<Delivery> pending = tree_.pending().deliveries;
  ASSERT_EQ(pending.size(), 2U);
  const std::string further = by_hand();
  EXPECT_THAT(error_of_sending(pending[0]), HasSubstr("its X-rays have a newer result, session " + further));
  EXPECT_EQ(tree_.newest_of_same_xrays(a_), further);
  EXPECT_EQ(tree_.sessions(), (std::vector{a_, further}));
  const std::string third = by_hand("rroe");
  EXPECT_EQ(third, a_ + "-3");
  EXPECT_THAT(error_of_release_by(further, "rroe"), HasSubstr("session " + third));
  EXPECT_EQ(lines_of("handed over"), 2);
  EXPECT_EQ(lines_of("registered"), 3);
}

TEST_F(DecisionsTest, OnlyAResultOfTheSameXraysIsHandedOver) {
  const fs::path other = tree_.registering(register_session(tree_, {"1.2.7"}, "review"));
  fs::create_directories(other);
  write_text(other / kResultFile, R"({"verdict": "review", "views": [{"sop_instance_uid": "1.2.7"}]})");
  EXPECT_THROW(tree_.hand_over(tree_.manual_basis(a_), made(other), "jdoe"), Error);
  EXPECT_TRUE(fs::exists(other));
  EXPECT_THAT(tree_.handed_over(), IsEmpty());
  EXPECT_EQ(lines_of("handed over"), 0);
}

TEST_F(DecisionsTest, ASecondResultWaitsUntilTheFirstHasBeenTakenOver) {
  tree_.hand_over(tree_.manual_basis(a_), write_by_hand(), "jdoe");
  const MadeResult second = write_by_hand("rroe");
  EXPECT_THROW(tree_.hand_over(tree_.manual_basis(a_), second, "rroe"), Error);
  EXPECT_TRUE(fs::exists(second.folder));
  tree_.take_over(a_);
  EXPECT_NO_THROW(tree_.hand_over(tree_.manual_basis(a_), second, "rroe"));
}

TEST_F(DecisionsTest, WhatWasBegunByHandBeforeAnotherResultOrderOrInputsIsNotHandedOver) {
  const ManualBasis before = tree_.manual_basis(a_);
  const auto error_of_hand_over = [&](const ManualBasis& basis) {
    fs::remove_all(tree_.registering(a_));
    try {
      tree_.hand_over(basis, write_by_hand("rroe"), "rroe");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  tree_.keep_order(a_, {.parts = {.study = "/in", .plan = "/in/another.dcm"}});
  EXPECT_THAT(error_of_hand_over(before), HasSubstr("registered in another way"));
  const ManualBasis with_plan = tree_.manual_basis(a_);
  SessionInputs inputs;
  inputs.parts[0] = {.versions = "other", .contents = "slices"};
  tree_.keep_inputs(a_, inputs);
  EXPECT_THAT(error_of_hand_over(with_plan), HasSubstr("registered in another way"));
  const ManualBasis with_slices = tree_.manual_basis(a_);
  EXPECT_EQ(with_slices.inputs, inputs);
  fs::remove_all(tree_.registering(a_));
  const std::string further = by_hand();
  EXPECT_EQ(tree_.inputs(further), inputs) << "of its basis";
  EXPECT_THAT(error_of_hand_over(with_slices), HasSubstr("have another result"));
  EXPECT_EQ(error_of_hand_over(tree_.manual_basis(a_)), "");
}

TEST_F(DecisionsTest, NothingIsReleasedWhileAResultByHandWaits) {
  tree_.hand_over(tree_.manual_basis(a_), write_by_hand(), "jdoe");
  EXPECT_THAT(error_of_release(a_), HasSubstr("newer result by hand, which isoshift room watch has yet to take over"));
  tree_.take_over(a_);
  EXPECT_THAT(error_of_release(a_), HasSubstr("have a newer result"));
}

TEST_F(DecisionsTest, OnlyADecisionIsTakenBackAlsoOneThatWasLost) {
  EXPECT_THROW(decide(DecisionKind::kReopened), Error);
  decide(DecisionKind::kAgreed);
  fs::remove(decided(1));
  EXPECT_THROW(decide(DecisionKind::kAgreed), Error);
  decide(DecisionKind::kReopened);
  EXPECT_THROW(decide(DecisionKind::kReopened), Error) << "twice";
  EXPECT_NO_THROW(decide(DecisionKind::kAgreed));
}

TEST_F(DecisionsTest, AnOrderIsKeptForEveryResultOfTheSameXrays) {
  const RegistrationOrder order{.parts = {.study = "/in", .doubts = {"one"}}, .flags = {"--preset", "fast"}};
  EXPECT_THROW((void)tree_.order("none"), Error);
  tree_.keep_order(a_, order);
  EXPECT_EQ(tree_.order(a_ + "-2"), order);
}

}  // namespace
}  // namespace isoshift::decisions_test
