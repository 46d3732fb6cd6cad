#include "workflow/room/results_tree.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "base/error.h"
#include "base/output_folder.h"
#include "tests/support/temporary_folder.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class ResultsTreeTest : public testing::Test {
 protected:
  ResultsTreeTest() : tree_(folder_ / "results") { put("a", "accepted"); }

  void put(const std::string& session, const std::string& verdict) {
    fs::create_directories(tree_.session(session));
    write_text(tree_.session(session) / "result.json", "{\"verdict\": \"" + verdict + "\"}");
    write_text(tree_.session(session) / "report.dcm", "report of " + session);
    if (verdict == "accepted") write_text(tree_.session(session) / "spatial_registration.dcm", "registration");
  }
  std::string error_of_release(const std::string& session) {
    try {
      tree_.release(session, "R. Roe", {"record"});
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::string audit() const {
    std::ifstream file(tree_.path() / "audit.jsonl");
    return {std::istreambuf_iterator<char>(file), {}};
  }

  TemporaryFolder folder_;
  ResultsTree tree_;
};

TEST_F(ResultsTreeTest, NothingIsPendingBeforeItIsReleased) {
  EXPECT_EQ(tree_.sessions(), std::vector<std::string>{"a"});
  EXPECT_TRUE(tree_.pending().empty());
  EXPECT_FALSE(tree_.release_of("a"));
}

TEST_F(ResultsTreeTest, EveryObjectIsPendingForEveryPeerUntilItIsSent) {
  tree_.release("a", "J. Doe", {"record", "archive"});
  std::vector<Delivery> pending = tree_.pending();
  ASSERT_EQ(pending.size(), 4U);
  EXPECT_EQ(tree_.checked_file(pending[0]), tree_.session("a") / pending[0].object.file);
  tree_.prepare_to_send(pending[0]);
  const ResultsTree killed(tree_.path());  // before the peer answered, or after
  EXPECT_EQ(killed.pending().size(), 4U);
  EXPECT_TRUE(killed.is_in_doubt(pending[0]));
  EXPECT_FALSE(killed.is_in_doubt(pending[1]));
  tree_.mark_sent(pending[0], "");
  const ResultsTree reopened(tree_.path());  // as after a kill
  EXPECT_EQ(reopened.pending().size(), 3U);
  EXPECT_EQ(reopened.release_of("a")->by, "J. Doe");
  EXPECT_THAT(audit(), HasSubstr("\"event\":\"released\""));
  EXPECT_THAT(audit(), HasSubstr("\"event\":\"sent\""));
}

TEST_F(ResultsTreeTest, LinesOfTheAuditLogThatAKilledProcessDidNotWriteAreAdded) {
  tree_.audit("registered", {{"session", "a"}});
  tree_.release("a", "J. Doe", {"record"});
  const Delivery sent = tree_.pending()[0];
  tree_.prepare_to_send(sent);
  tree_.mark_sent(sent, "");
  const std::string before = audit();
  tree_.complete_audit();
  EXPECT_EQ(audit(), before);
  replace_text(tree_.path() / "audit.jsonl", before.substr(0, before.find('\n') + 20));  // the second line is cut
  tree_.complete_audit();
  EXPECT_THAT(audit(), HasSubstr("\"event\":\"released\",\"session\":\"a\",\"by\":\"J. Doe\""));
  EXPECT_THAT(audit(), HasSubstr("\"event\":\"sent\",\"session\":\"a\",\"peer\":\"record\""));
  EXPECT_THAT(audit(), HasSubstr("at the next start"));
  EXPECT_THAT(audit(), HasSubstr("\n{\"on\":"));  // a line of its own behind the cut one
  EXPECT_THAT(audit().substr(before.find('\n')), testing::Not(HasSubstr("registered")));
}

TEST_F(ResultsTreeTest, ASessionIsReleasedOnce) {
  tree_.release("a", "J. Doe", {"record"});
  EXPECT_THAT(error_of_release("a"), HasSubstr("has been released by J. Doe on "));
  EXPECT_EQ(tree_.release_of("a")->by, "J. Doe");
}

TEST_F(ResultsTreeTest, WhatMayNotBeReleasedIsRefused) {
  put("r", "rejected");
  EXPECT_THAT(error_of_release("r"), HasSubstr("was rejected"));
  EXPECT_THAT(error_of_release("b"), HasSubstr("holds no session b"));
  EXPECT_THAT(error_of_release("../sessions/a"), HasSubstr("holds no session"));
  put("v", "review");
  EXPECT_EQ(tree_.release("v", "J. Doe", {"record"}).objects.size(), 1U);  // its report
}

TEST_F(ResultsTreeTest, AnObjectThatChangedSinceIsNotSent) {
  tree_.release("a", "J. Doe", {"record"});
  std::ofstream(tree_.session("a") / "report.dcm") << "another";
  std::string message;
  for (const Delivery& delivery : tree_.pending()) {
    try {
      tree_.checked_file(delivery);
    } catch (const Error& error) {
      message = error.what();
    }
  }
  EXPECT_THAT(message, HasSubstr("is not what was released"));
}

TEST_F(ResultsTreeTest, WhatAKilledProcessLeftIsNoSession) {
  fs::create_directories(tree_.session("b.partial-xyz"));
  write_text(tree_.session("b.partial-xyz") / "result.json", "{}");
  EXPECT_EQ(tree_.sessions().size(), 1U);
  tree_.clean();
  EXPECT_FALSE(fs::exists(tree_.session("b.partial-xyz")));
}

}  // namespace
}  // namespace isoshift
