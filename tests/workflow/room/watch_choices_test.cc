// What people choose where the files do not tell: the X-rays of one setup, their patient, the plan, the CT.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/output_folder.h"
#include "tests/support/treatment_room.h"
#include "workflow/room/engine_state.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/session_options.h"

namespace isoshift::watch_choices_test {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using Xrays = std::set<std::string>;

class WatchChoices : public testing::Test {
 protected:
  WatchChoices() { room_.start(); }

  // X-rays that do not tell their plan.
  void bring_pair(double first, double second) {
    for (StudyFiles one : {xray("P", "ap", "AP", first), xray("P", "lat", "LAT", second)}) {
      one.images[0].plan_uid = "";
      room_.source.bring(one);
    }
  }
  void bring_plan(const std::string& uid, const std::string& patient = "P\\") {
    StudyFiles plan = plan_of("P");
    plan.plans[0].file = "/in/" + uid;
    plan.plans[0].sop_instance_uid = uid;
    plan.plans[0].label = uid + " 20260301";
    plan.plans[0].patient = patient;
    room_.source.bring(plan);
  }
  void bring_ct(const std::string& uid, const std::string& patient = "P\\") {
    StudyFiles ct = ct_of("P");
    ct.cts[0].series_instance_uid = uid;
    ct.cts[0].files = {"/in/" + uid};
    ct.cts[0].sop_instance_uids = {uid + ".1"};
    ct.cts[0].patient = patient;
    room_.source.bring(ct);
  }
  // A session that cannot be registered before a person chooses.
  void wait_with_two_plans() {
    bring_ct("ct");
    bring_plan("A");
    bring_plan("B");
    bring_pair(second_of(10, 15), second_of(10, 15, 10));
    room_.pass(60s);
  }
  SessionOptions options(const Xrays& xrays) const {
    const auto engine = read_engine_state(room_.file.results, room_.clock.file_time());
    for (const auto* sessions : {&engine->state.waiting, &engine->state.chosen})
      for (const WaitingSession& one : *sessions)
        if (one.name == session_name(xrays)) return one.options;
    ADD_FAILURE() << "does not wait";
    return {};
  }
  // From the options of the session of `of`.
  void choose(const Xrays& of, const ChosenIds& ids, const std::string& by = "jdoe") {
    Choice choice = chosen_from(options(of), ids);
    choice.by = by;
    choice.patient_id = "P";
    choice.reason = "the panel had failed";
    ResultsTree(room_.file.results).choose(choice);
  }
  void withdraw(const Xrays& xrays) {
    ResultsTree tree(room_.file.results);
    Choice withdrawn = tree.choice(session_name(xrays)).value();
    withdrawn.is_withdrawn = true;
    tree.choose(withdrawn);
  }
  std::string objection(const Xrays& xrays) const {
    return ResultsTree(room_.file.results).objection(session_name(xrays)).words;
  }

  TreatmentRoom room_;
};

TEST_F(WatchChoices, OfTwoPlans) {
  wait_with_two_plans();
  ASSERT_THAT(room_.runs(), IsEmpty());
  EXPECT_THAT(room_.index(), HasSubstr("2 RT Plans"));
  const SessionOptions options = this->options({"ap", "lat"});
  EXPECT_THAT(options.plans,
              ElementsAre(Candidate{"A", "the RT Plan A 20260301 (A)"}, Candidate{"B", "the RT Plan B 20260301 (B)"}));
  EXPECT_THAT(options.other_xrays, IsEmpty());
  EXPECT_THAT(options.cts, IsEmpty());
  choose({"ap", "lat"}, {.xrays = {"ap", "lat"}, .plan = "B"});
  room_.pass(5s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(1));
  EXPECT_EQ(room_.runner.runs()[0].plan, "B");
  ASSERT_THAT(room_.runner.runs()[0].doubts, SizeIs(1));
  EXPECT_THAT(room_.runner.runs()[0].doubts[0], HasSubstr("jdoe chose on "));
  EXPECT_THAT(room_.runner.runs()[0].doubts[0], HasSubstr("the RT Plan B 20260301 (B) (the panel had failed)"));
  EXPECT_THAT(room_.runner.runs()[0].flags, Not(testing::Contains("--allow")));
  room_.pass(600s);
  room_.start();
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(1)) << "for nothing";
  EXPECT_EQ(objection({"ap", "lat"}), "");
}

TEST_F(WatchChoices, OfTwoCtsAfterThePlan) {
  bring_ct("ct1");
  bring_ct("ct2");
  bring_plan("A");
  bring_plan("B");
  bring_pair(second_of(10, 15), second_of(10, 15, 10));
  room_.pass(60s);
  const Xrays both{"ap", "lat"};
  choose(both, {.xrays = both, .plan = "A"});
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), IsEmpty()) << "which CT is not known";
  choose(both, {.xrays = both, .plan = "A", .ct = "ct2"}, "rroe");
  room_.pass(60s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(1));
  EXPECT_EQ(room_.runner.runs()[0].plan, "A");
  EXPECT_EQ(room_.runner.runs()[0].ct, "ct2");
}

TEST_F(WatchChoices, AnHourBetweenTheViews) {
  bring_ct("ct");
  bring_plan("A");
  bring_pair(second_of(10, 15), second_of(11, 20));
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("1 of 2 X-rays"));
  EXPECT_THAT(options({"ap"}).other_xrays, ElementsAre(Candidate{"lat", "LAT 2026-03-02 11:20:00"}));
  choose({"ap"}, {.xrays = {"ap", "lat"}});
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"ap", "lat"}));
  ASSERT_THAT(room_.runner.runs(), SizeIs(1));
  const auto& flags = room_.runner.runs()[0].flags;
  ASSERT_THAT(flags, SizeIs(testing::Ge(2U)));
  EXPECT_EQ(flags[flags.size() - 2], "--allow");
  EXPECT_THAT(flags.back(), HasSubstr("time-span=jdoe chose on "));
  EXPECT_THAT(
      room_.runner.runs()[0].doubts[0],
      HasSubstr(
          "for AP 2026-03-02 10:15:00 and LAT 2026-03-02 11:20:00: that they show one setup (the panel had failed)"));
  EXPECT_EQ(objection({"ap", "lat"}), "");
  EXPECT_THAT(room_.index(), HasSubstr("1 sessions registered, 0 waiting"));
  // The files of a chosen session change like those of any other.
  room_.contents.written["/in/A"] = "revised";
  bring_plan("A");
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(2));
  EXPECT_THAT(room_.runner.runs()[1].flags, testing::Contains("--allow"));
}

TEST_F(WatchChoices, OfTheIssuer) {
  for (const char* issuer : {"A", "B"}) {
    bring_ct(std::string("ct") + issuer, std::string("P\\") + issuer);
    bring_plan(std::string("plan") + issuer, std::string("P\\") + issuer);
  }
  bring_pair(second_of(10, 15), second_of(10, 15, 10));
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("waits for the CT"));
  const Xrays both{"ap", "lat"};
  EXPECT_THAT(options(both).patients, ElementsAre(Candidate{"P\\A", "the patient ID of the issuer A"},
                                                  Candidate{"P\\B", "the patient ID of the issuer B"}));
  choose(both, {.xrays = both, .patient = "P\\B"});
  room_.pass(60s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(1));
  EXPECT_EQ(room_.runner.runs()[0].ct, "ctB");
  EXPECT_EQ(room_.runner.runs()[0].plan, "planB");
}

TEST_F(WatchChoices, ARetakeWithAnXrayThatHasAResult) {
  bring_ct("ct");
  bring_plan("A");
  bring_pair(second_of(10, 15), second_of(10, 15, 10));
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  StudyFiles again = xray("P", "ap2", "AP", second_of(10, 17));
  again.images[0].plan_uid = "";
  room_.source.bring(again);
  room_.pass(60s);
  const std::string first = session_name({"ap", "lat"});
  EXPECT_THAT(options({"ap2"}).other_xrays,
              ElementsAre(Candidate{"ap", "AP 2026-03-02 10:15:00 of session " + first},
                          Candidate{"lat", "LAT 2026-03-02 10:15:10 of session " + first}));
  choose({"ap2"}, {.xrays = {"ap2", "lat"}});
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), ElementsAre(Xrays{"ap", "lat"}, Xrays{"ap2", "lat"}));
  EXPECT_THAT(objection({"ap", "lat"}), HasSubstr("newer X-rays"));
  for (const Xrays& xrays : {Xrays{"ap", "lat"}, Xrays{"ap2", "lat"}})
    EXPECT_THAT(objection(xrays), HasSubstr("has a result of some of these X-rays with others"));
}

TEST_F(WatchChoices, NothingIsOfferedWhereTheFilesTell) {
  bring_pair(second_of(10, 15), second_of(10, 15, 10));
  room_.pass(60s);
  EXPECT_FALSE(options({"ap", "lat"}).is_anything()) << "waits for the CT";
}

TEST_F(WatchChoices, AnotherPlansXraysAreNotOffered) {
  room_.source.bring(xray("P", "ap", "AP", second_of(10, 15)));
  StudyFiles other = xray("P", "lat", "LAT", second_of(10, 40));
  other.images[0].plan_uid = "another";
  room_.source.bring(other);
  room_.source.bring(xray("P", "old", "LAT", second_of(10, 15) - 3 * 24 * 3600.0));
  room_.pass(60s);
  EXPECT_FALSE(options({"ap"}).is_anything());
}

TEST_F(WatchChoices, OfAPlanWhatOtherXraysSayCountsOn) {
  bring_ct("ct");
  bring_plan("A");
  bring_plan("B");
  bring_pair(second_of(10, 15), second_of(10, 15, 40));
  room_.pass(60s);
  const Xrays both{"ap", "lat"};
  choose(both, {.xrays = both, .plan = "A"});
  room_.pass(60s);
  EXPECT_EQ(objection(both), "");
  StudyFiles between = xray("P", "ap2", "AP", second_of(10, 15, 20));
  between.images[0].plan_uid = "";
  room_.source.bring(between);
  room_.pass(60s);
  EXPECT_THAT(objection(both), HasSubstr("would be grouped in another way"));
}

TEST_F(WatchChoices, OfAGroupNewXraysCountAndThoseInTheReportDoNot) {
  bring_ct("ct");
  bring_plan("A");
  bring_pair(second_of(10, 15), second_of(11, 20));
  StudyFiles between = xray("P", "ap2", "AP", second_of(10, 40));
  between.images[0].plan_uid = "";
  room_.source.bring(between);
  room_.pass(60s);
  const Xrays both{"ap", "lat"};
  choose({"ap"}, {.xrays = both});
  room_.pass(60s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(1));
  EXPECT_THAT(room_.runner.runs()[0].doubts, testing::Contains(HasSubstr("/in/ap2 was taken between these views")));
  EXPECT_EQ(objection(both), "") << "the report tells of it";
  StudyFiles later = xray("P", "ap3", "AP", second_of(10, 50));
  later.images[0].plan_uid = "";
  room_.source.bring(later);
  room_.pass(60s);
  EXPECT_THAT(objection(both), HasSubstr("/in/ap3 was taken between these views"));
}

TEST_F(WatchChoices, AChoiceIsMadeAgainAfterTheRegistration) {
  wait_with_two_plans();
  const Xrays both{"ap", "lat"};
  choose(both, {.xrays = both, .plan = "A"});
  room_.pass(60s);
  const SessionOptions again = options(both);
  EXPECT_EQ(again.chosen, (ChosenIds{.xrays = both, .patient = "", .plan = "A", .ct = ""}));
  choose(both, {.xrays = both, .plan = "B"}, "rroe");
  room_.pass(60s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(2));
  EXPECT_EQ(room_.runner.runs()[1].plan, "B");
  EXPECT_THAT(room_.index(), HasSubstr("superseded by session " + session_name(both) + "-2"));
  room_.pass(600s);
  EXPECT_THAT(room_.runs(), SizeIs(2)) << "for nothing";
}

TEST_F(WatchChoices, AChoiceDuringTheRegistrationCountsAfterIt) {
  wait_with_two_plans();
  const Xrays both{"ap", "lat"};
  const SessionOptions options = this->options(both);
  room_.runner.length = 20s;
  choose(both, {.xrays = both, .plan = "A"});
  room_.pass(5s);
  Choice second = chosen_from(options, {.xrays = both, .plan = "B"});
  second.by = "rroe";
  second.patient_id = "P";
  ResultsTree(room_.file.results).choose(second);
  room_.pass(120s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(2));
  EXPECT_EQ(room_.runner.runs()[1].plan, "B");
}

TEST_F(WatchChoices, APlanThatHasGoneGivesWayToAnother) {
  bring_ct("ct");
  bring_plan("A");
  bring_pair(second_of(10, 15), second_of(11, 20));
  room_.pass(60s);
  const Xrays both{"ap", "lat"};
  Choice choice = chosen_from(options({"ap"}), {.xrays = both});
  choice.plan = {"gone", "the RT Plan gone"};
  choice.by = "jdoe";
  choice.patient_id = "P";
  ResultsTree(room_.file.results).choose(choice);
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("waits for the RT Plan gone"));
  choose(both, {.xrays = both});
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(1));
}

TEST_F(WatchChoices, AWithdrawnChoiceLeavesTheXraysAsTheyWere) {
  bring_ct("ct");
  bring_plan("A");
  bring_pair(second_of(10, 15), second_of(11, 20));
  room_.pass(60s);
  const Xrays both{"ap", "lat"};
  room_.runner.failure = {.why = "the table moved", .may_be_over_soon = false};
  choose({"ap"}, {.xrays = both});
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("the table moved"));
  withdraw(both);
  room_.pass(60s);
  EXPECT_THAT(room_.index(), Not(HasSubstr("the table moved")));
  EXPECT_THAT(options({"ap"}).other_xrays, SizeIs(1));
  EXPECT_THAT(options({"lat"}).other_xrays, SizeIs(1));
}

TEST_F(WatchChoices, AfterAWithdrawnChoiceWithAResultAPersonChoosesAgain) {
  wait_with_two_plans();
  const Xrays both{"ap", "lat"};
  choose(both, {.xrays = both, .plan = "A"});
  room_.pass(60s);
  withdraw(both);
  room_.pass(60s);
  EXPECT_THAT(objection(both), testing::AllOf(HasSubstr("jdoe withdrew on "), HasSubstr("2 RT Plans")));
  choose(both, {.xrays = both, .plan = "A"}, "rroe");
  room_.pass(60s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(2)) << "by another person, of the same plan";
  EXPECT_THAT(room_.runner.runs()[1].doubts[0], HasSubstr("rroe chose on "));
  EXPECT_EQ(ResultsTree(room_.file.results).objection(session_name(both) + "-2").words, "");
  room_.pass(600s);
  room_.start();
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(2)) << "for nothing";
}

TEST_F(WatchChoices, OfASecondPlanThatCameAfterTheResult) {
  bring_ct("ct");
  bring_plan("A");
  bring_pair(second_of(10, 15), second_of(10, 15, 10));
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  bring_plan("B");
  room_.pass(60s);
  const Xrays both{"ap", "lat"};
  EXPECT_THAT(objection(both), HasSubstr("2 RT Plans"));
  choose(both, {.xrays = both, .plan = "A"});
  room_.pass(60s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(2));
  EXPECT_EQ(room_.runner.runs()[1].plan, "A");
}

TEST_F(WatchChoices, APlanThatComesAfterTheChoiceSpeaksAgainstItsResult) {
  wait_with_two_plans();
  const Xrays both{"ap", "lat"};
  choose(both, {.xrays = both, .plan = "A"});
  room_.pass(60s);
  ASSERT_EQ(objection(both), "");
  bring_plan("C");
  room_.pass(60s);
  EXPECT_THAT(objection(both), HasSubstr("a person had chosen before the RT Plan C 20260301 (C) came"));
  choose(both, {.xrays = both, .plan = "C"});
  room_.pass(60s);
  ASSERT_THAT(room_.runner.runs(), SizeIs(2));
  EXPECT_EQ(room_.runner.runs()[1].plan, "C");
  EXPECT_EQ(ResultsTree(room_.file.results).objection(session_name(both) + "-2").words, "");
}

TEST_F(WatchChoices, ALostChoiceIsSaidAndMadeAgain) {
  wait_with_two_plans();
  const Xrays both{"ap", "lat"};
  room_.runner.failure = {.why = "error: out of memory", .may_be_over_soon = false};
  choose(both, {.xrays = both, .plan = "A"});
  room_.pass(60s);
  std::filesystem::remove(room_.file.results / "chosen" / (session_name(both) + ".1.json"));
  room_.pass(5s);
  EXPECT_THAT(room_.index(), HasSubstr("audit.jsonl tells of a choice"));
  room_.runner.failure.reset();
  choose(both, {.xrays = both, .plan = "B"});
  room_.pass(60s);
  EXPECT_THAT(room_.index(), Not(HasSubstr("audit.jsonl tells of a choice")));
  EXPECT_EQ(room_.runner.runs().back().plan, "B");
}

TEST_F(WatchChoices, XraysOfAnotherIssuerOrDeletedOnesAreNotOffered) {
  bring_ct("ct");
  bring_plan("A");
  bring_pair(second_of(10, 15), second_of(10, 15, 10));
  room_.pass(60s);
  ASSERT_THAT(room_.runs(), SizeIs(1));
  ResultsTree(room_.file.results).remove(session_name({"ap", "lat"}), "jdoe");
  StudyFiles next = xray("P", "ap2", "AP", second_of(10, 30)), other = xray("P", "ap3", "AP", second_of(10, 50));
  next.images[0].patient = "P\\A";
  other.images[0].patient = "P\\B";
  for (StudyFiles* one : {&next, &other}) {
    one->images[0].plan_uid = "";
    room_.source.bring(*one);
  }
  room_.pass(60s);
  EXPECT_THAT(options({"ap2"}).other_xrays, IsEmpty());
}

TEST_F(WatchChoices, APlanThatTheXraysNameIsNotChosen) {
  bring_ct("ct");
  bring_plan("A");
  bring_plan("B");
  room_.source.bring(xray("P", "ap", "AP", second_of(10, 15)));
  room_.source.bring(xray("P", "lat", "LAT", second_of(10, 15, 10)));
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("waits for the RT Plan plan.P"));
  EXPECT_THAT(options({"ap", "lat"}).plans, IsEmpty());
}

TEST_F(WatchChoices, AChoiceWithoutAResultIsDeletedOnRequest) {
  bring_pair(second_of(10, 15), second_of(11, 20));
  room_.pass(60s);
  const Xrays both{"ap", "lat"};
  choose({"ap"}, {.xrays = both});
  room_.pass(60s);
  EXPECT_THAT(room_.index(), HasSubstr("waits for the CT"));
  ResultsTree(room_.file.results).remove(session_name(both), "jdoe");
  EXPECT_TRUE(std::filesystem::is_empty(room_.file.results / "chosen"));
  room_.pass(60s);
  EXPECT_THAT(room_.index(), Not(HasSubstr("waits")));
}

TEST_F(WatchChoices, AForgedChoiceDoesNotCount) {
  wait_with_two_plans();
  Choice forged = chosen_from(options({"ap", "lat"}), {.xrays = {"ap", "lat"}, .plan = "B"});
  replace_text(room_.file.results / "chosen" / (forged.session + ".1.json"), json_of(forged).dump());
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), IsEmpty());
  EXPECT_THAT(room_.index(), HasSubstr("is not the newest choice"));
}

TEST_F(WatchChoices, ChoicesAreDeletedWithTheirResults) {
  wait_with_two_plans();
  const Xrays both{"ap", "lat"};
  choose(both, {.xrays = both, .plan = "B"});
  room_.pass(60s);
  ResultsTree(room_.file.results).remove(session_name(both), "jdoe");
  EXPECT_TRUE(std::filesystem::is_empty(room_.file.results / "chosen")) << "it names X-rays of the patient";
  room_.pass(60s);
  EXPECT_THAT(room_.runs(), SizeIs(1));
}

TEST_F(WatchChoices, OnlyWhatIsOfferedIsChosen) {
  const SessionOptions options{.own_xrays = {{"ap", "AP"}, {"lat", "LAT"}},
                               .other_xrays = {},
                               .patients = {},
                               .plans = {{"A", "the RT Plan A"}, {"B", "the RT Plan B"}},
                               .cts = {},
                               .chosen = std::nullopt};
  EXPECT_EQ(chosen_from(options, {.xrays = {"ap", "lat"}, .plan = "A"}).plan.words, "the RT Plan A");
  EXPECT_THROW(chosen_from(options, {.xrays = {"ap", "lat"}, .plan = "C"}), Error);
  EXPECT_THROW(chosen_from(options, {.xrays = {"ap", "cbct"}}), Error);
  EXPECT_THROW(chosen_from(options, {.xrays = {"ap", "lat"}}), Error) << "nothing is chosen";
  EXPECT_THROW(chosen_from(options, {.xrays = {}}), Error);
}

}  // namespace
}  // namespace isoshift::watch_choices_test
