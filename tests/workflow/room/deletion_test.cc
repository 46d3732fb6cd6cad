// Results that are deleted, on request or by the rule of the watch file.

#include "workflow/room/deletion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/json_file.h"
#include "base/output_folder.h"
#include "io/report/result_folder.h"
#include "tests/support/command.h"
#include "tests/support/watch_releases.h"

namespace isoshift::deletion_test {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

class DeletionTest : public WatchReleases {
 protected:
  DeletionTest() {
    room_.start();
    bring("P");
    bring("Q");
    room_.pass(60s);
  }
  std::vector<std::string> sessions() const { return ResultsTree(room_.file.results).sessions(); }
  // All files of the results tree that are named after a session of P.
  std::vector<std::string> files_of_p() const {
    std::vector<std::string> files;
    for (const auto& entry : fs::recursive_directory_iterator(room_.file.results))
      if (entry.is_regular_file() && entry.path().string().find(session("P")) != std::string::npos)
        files.push_back(entry.path().parent_path().filename() / entry.path().filename());
    return files;
  }
};

TEST_F(DeletionTest, WhatWasDeletedIsGoneAndNotRegisteredAgain) {
  release("P");
  room_.pass(30s);
  ASSERT_THAT(room_.index(), HasSubstr(session("P")));
  ResultsTree(room_.file.results).remove(session("P"), "J. Doe");
  room_.pass(600s);
  EXPECT_THAT(files_of_p(), ElementsAre("deleted/" + session("P") + ".json"));
  EXPECT_THAT(room_.index(), Not(HasSubstr(session("P"))));
  EXPECT_THAT(audit(), HasSubstr(R"("event":"deleted","session":")" + session("P") + R"(","by":"J. Doe")"));
  room_.start();
  room_.source.bring(plan_of("P"));
  room_.pass(600s);
  EXPECT_THAT(sessions(), ElementsAre(session("Q")));
  EXPECT_THAT(room_.runs(), SizeIs(2));
  EXPECT_THAT(room_.index(), HasSubstr("1 sessions registered, 0 waiting"));
}

TEST_F(DeletionTest, AllResultsOfTheXraysAreDeleted) {
  room_.contents.written["/in/plan.P"] = "revised";
  room_.source.bring(plan_of("P"));
  room_.pass(60s);
  ASSERT_THAT(sessions(), SizeIs(3));
  ResultsTree(room_.file.results).remove(session("P") + "-2", "J. Doe");
  EXPECT_THAT(sessions(), ElementsAre(session("Q")));
  room_.pass(600s);
  EXPECT_THAT(room_.runs(), SizeIs(3));
}

TEST_F(DeletionTest, WhatIsStillToBeSentIsNotDeleted) {
  room_.sender.down = {"record"};
  release("P");
  room_.pass(10s);
  ResultsTree tree(room_.file.results);
  EXPECT_THROW(tree.remove(session("P"), "J. Doe"), Error);
  EXPECT_THAT(sessions(), SizeIs(2));
  tree.decide({.kind = DecisionKind::kRejected,
               .session = session("P"),
               .record = tree.registered(session("P")).sha256,
               .reason = "not wanted",
               .by = "J. Doe"});
  tree.remove(session("P"), "J. Doe");
  EXPECT_THAT(sessions(), ElementsAre(session("Q")));
}

TEST_F(DeletionTest, ADamagedResultIsDeletedToo) {
  const fs::path folder = room_.file.results / "sessions" / session("P");
  replace_text(folder / kResultFile, "{");
  ResultsTree(room_.file.results).remove(session("P"), "J. Doe");
  EXPECT_THAT(sessions(), ElementsAre(session("Q")));
}

TEST_F(DeletionTest, AKilledDeletionIsFinished) {
  put_deletion(room_.file.results, {.session = session("P"), .by = "J. Doe", .user = "u", .on = "now", .xrays = {}});
  room_.start();
  room_.pass(1s);
  EXPECT_THAT(files_of_p(), ElementsAre("deleted/" + session("P") + ".json"));
}

TEST_F(DeletionTest, ResultsAreDeletedWhenTheirDaysAreOver) {
  room_.file.keep_days = 30;
  room_.start();
  release("Q");
  room_.sender.down = {"record"};
  room_.pass(std::chrono::days(29), 3600s);
  EXPECT_THAT(sessions(), SizeIs(2));
  room_.pass(std::chrono::days(3), 3600s);
  EXPECT_THAT(sessions(), ElementsAre(session("Q"))) << "it is still to be sent";
  EXPECT_THAT(audit(), HasSubstr(R"("by":"keep_days 30 of the watch file")"));
  room_.sender.down = {};
  room_.pass(std::chrono::days(2), 3600s);
  EXPECT_THAT(sessions(), IsEmpty());
  EXPECT_THAT(room_.index(), HasSubstr("0 sessions registered, 0 waiting"));
  for (const auto& entry : fs::directory_iterator(room_.file.results))
    EXPECT_FALSE(entry.path().filename().string().starts_with("sessions-")) << entry.path();
}

TEST_F(DeletionTest, TheCommandDeletesAllOfAPatient) {
  const fs::path site = room_.folder / "site.json", watch = room_.folder / "watch.json";
  write_text(site, R"({"site_file": 1, "name": "S", "sessions": {"views": 2, "quiet_s": 5}})");
  write_text(watch, R"({"watch_file": 1, "folder": ".", "results": "results", "site": "site.json"})");
  const auto run = [&](std::vector<std::string> flags) {
    flags.insert(flags.begin(), {"room", "delete"});
    flags.insert(flags.end(), {"--by", "J. Doe", "--watch", watch.string()});
    return run_command(flags);
  };
  EXPECT_EQ(run({}).exit_status, 2);
  EXPECT_EQ(run({"--patient", "R"}).exit_status, 1);
  EXPECT_EQ(run({"0123456789ab"}).exit_status, 1);
  ASSERT_THAT(sessions(), SizeIs(2));
  // The ID of one patient reads like that of another with its issuer.
  const auto set_patient = [&](const std::string& patient, const std::string& id, const std::string& issuer) {
    const fs::path file = room_.file.results / "sessions" / session(patient) / kResultFile;
    nlohmann::json result = read_json_file(file).json;
    result["patient"]["id"] = id;
    result["patient"]["id_issuer"] = issuer;
    replace_text(file, result.dump());
  };
  set_patient("P", "P", "A");
  set_patient("Q", "P (A)", "");
  EXPECT_EQ(run({"--patient", "P (A)"}).exit_status, 1);
  EXPECT_THAT(sessions(), SizeIs(2));
  const CommandOutcome outcome = run({"--patient", "P"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("session " + session("P") + ": deleted"));
  EXPECT_THAT(sessions(), ElementsAre(session("Q")));
}

}  // namespace
}  // namespace isoshift::deletion_test
