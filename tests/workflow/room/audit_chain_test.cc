#include "workflow/room/audit_chain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "base/error.h"
#include "base/sha256.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"
#include "workflow/room/audit_log.h"

namespace isoshift::audit_chain_test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class AuditChainTest : public testing::Test {
 protected:
  std::string text() const {
    std::ifstream file(path_);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void put(const std::string& text) const { std::ofstream(path_) << text; }
  // Lines 1 to 5.
  void add_five() {
    for (const char* record : {"r1", "r2", "r3", "r4", "r5"})
      log_.append("registered", {{"session", "a"}, {"record", record}});
  }
  CommandOutcome audit(std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"room", "audit", path_.string()});
    return run_command(more);
  }

  TemporaryFolder folder_;
  fs::path path_ = folder_ / "audit.jsonl";
  AuditLog log_{path_};
};

TEST_F(AuditChainTest, WhatHasNoLinkIsNotCalledWhole) {
  for (const char* log : {"", "some text\n", "{\"event\": \"registered\"}\n"}) {
    put(log);
    EXPECT_EQ(audit().exit_status, 1) << log;
    EXPECT_THAT(audit().err, HasSubstr("audit.jsonl: no line has a link"));
    EXPECT_THAT(audit().out, testing::Not(HasSubstr("whole")));
  }
}

// What `head -n -0 | sha256sum` of a shell says.
TEST_F(AuditChainTest, EveryLineHoldsTheHashOfTheLineBefore) {
  add_five();
  std::ifstream file(path_);
  std::string before;
  for (std::string line; std::getline(file, line); before = line + "\n")
    EXPECT_EQ(link_of(Json::parse(line)), sha256_of(before));
  const AuditChain chain = chain_of(text());
  EXPECT_EQ(chain.lines, 5U);
  EXPECT_THAT(chain.broken, IsEmpty());
  EXPECT_EQ(chain.head(), sha256_of(before));
  EXPECT_EQ(log_.head(), chain.head());
}

TEST_F(AuditChainTest, LinesThatAreChangedTakenOutPutInOrMovedBreakIt) {
  add_five();
  const std::string whole = text();
  std::vector<std::string> lines;
  std::ifstream file(path_);
  for (std::string line; std::getline(file, line);) lines.push_back(line + "\n");
  const auto broken_of = [&](const std::vector<std::size_t>& numbers) {
    std::string forged;
    for (const std::size_t n : numbers) forged += lines[n - 1];
    return chain_of(forged).broken;
  };
  EXPECT_THAT(broken_of({1, 2, 3, 4, 5}), IsEmpty());
  EXPECT_THAT(broken_of({1, 2, 4, 5}), ElementsAre(3));
  EXPECT_THAT(broken_of({2, 3, 4, 5}), ElementsAre(1));
  EXPECT_THAT(broken_of({1, 3, 2, 4, 5}), ElementsAre(2, 3, 4));
  EXPECT_THAT(broken_of({1, 2, 2, 3, 4, 5}), ElementsAre(3));
  std::string forged = whole;
  forged.replace(forged.find("r3"), 2, "r9");
  EXPECT_THAT(chain_of(forged).broken, ElementsAre(4));
  forged = whole;
  forged.insert(forged.find("{\"on\"", 10), "{\"event\":\"released\",\"session\":\"a\"}\n");
  EXPECT_THAT(chain_of(forged).broken, ElementsAre(2, 3));
}

TEST_F(AuditChainTest, NothingIsProvenByABrokenLogUntilAPersonHasRecordedIt) {
  add_five();
  const std::string head = log_.head();
  std::string forged = text();
  forged.replace(forged.find("r3"), 2, "r9");
  put(forged);
  AuditLog again(path_);
  try {
    again.has_registration("a", "r5");
    ADD_FAILURE() << "a broken log was believed";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("audit.jsonl: line 4 does not follow from those before it"));
  }
  CommandOutcome outcome = audit();
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("broken: line 4: this line, or lines before it, were changed"));
  EXPECT_EQ(audit({"--repair", "disk error of March 3"}).exit_status, 2);  // who?
  outcome = audit({"--repair", "disk error of March 3", "--by", "J. Doe"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("recorded: J. Doe has looked at line 4"),
                                 HasSubstr("broken, and repaired by a person since: line 4"), HasSubstr("whole")));
  EXPECT_TRUE(again.has_registration("a", "r5"));
  EXPECT_THAT(text(), HasSubstr(R"("event":"repaired","by":"J. Doe")"));
  EXPECT_EQ(audit({"--repair", "again", "--by", "J. Doe"}).exit_status, 1);  // there is nothing to repair
  EXPECT_EQ(audit({"--head", head}).exit_status, 0);
  // What was looked at does not allow what comes later.
  forged = text();
  forged.replace(forged.find("r1"), 2, "r9");
  put(forged);
  EXPECT_EQ(audit().exit_status, 1);
}

TEST_F(AuditChainTest, AHeadThatWasKeptShowsLinesCutOffAtTheEnd) {
  add_five();
  const std::string earlier = text();
  log_.append("stopped", Json::object());
  const std::string head = log_.head();
  EXPECT_EQ(audit({"--head", head}).exit_status, 0);
  log_.append("started", Json::object());
  EXPECT_EQ(audit({"--head", head}).exit_status, 0);
  put(earlier);
  EXPECT_EQ(audit().exit_status, 0);
  const CommandOutcome outcome = audit({"--head", head});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("--head: the log that held " + head + " had other lines, or more"));
}

TEST_F(AuditChainTest, ALogWithoutLinksIsCoveredByTheFirstOne) {
  const std::string old = "{\"event\":\"registered\",\"session\":\"a\",\"record\":\"r0\"}\n{\"event\":\"stopped\"}\n";
  put(old);
  EXPECT_TRUE(log_.has_registration("a", "r0"));
  add_five();
  AuditChain chain = chain_of(text());
  EXPECT_EQ(chain.without_link, 2U);
  EXPECT_THAT(chain.broken, IsEmpty());
  EXPECT_TRUE(chain.links.contains(sha256_of(old)));
  std::string forged = text();
  forged.replace(forged.find("r0"), 2, "r9");
  EXPECT_THAT(chain_of(forged).broken, ElementsAre(3));
}

TEST_F(AuditChainTest, ALineThatWasCutOffBreaksNothingAndIsCovered) {
  add_five();
  std::ofstream(path_, std::ios::app) << "{\"on\":\"2026-03-0";
  log_.append("registered", {{"session", "a"}, {"record", "r6"}});
  EXPECT_THAT(chain_of(text()).broken, IsEmpty());
  EXPECT_TRUE(log_.has_registration("a", "r6"));
  std::string forged = text();
  forged.erase(forged.find("{\"on\":\"2026-03-0\n"), 17);
  EXPECT_THAT(chain_of(forged).broken, ElementsAre(6));
}

// Longer than what is read of the log's end at first.
TEST_F(AuditChainTest, LongLinesAreLinked) {
  add_five();
  for (const int length : {3'000, 5'000, 100'000}) log_.append("failed", {{"session", std::string(length, 'x')}});
  std::ofstream(path_, std::ios::app) << std::string(50'000, ' ') << "\n";
  log_.append("stopped", Json::object());
  const AuditChain chain = chain_of(text());
  EXPECT_EQ(chain.lines, 10U);
  EXPECT_THAT(chain.broken, IsEmpty());
}

}  // namespace
}  // namespace isoshift::audit_chain_test
