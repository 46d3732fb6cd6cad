#include "workflow/room/audit_log.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <fstream>
#include <iterator>
#include <thread>
#include <vector>

#include "base/error.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/temporary_folder.h"
#include "workflow/room/audit_chain.h"

namespace isoshift::audit_log_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class AuditLogTest : public testing::Test {
 protected:
  std::string text() const {
    std::ifstream file(path_);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void add(const std::string& text) const { std::ofstream(path_, std::ios::app) << text; }
  static nlohmann::ordered_json registration(const std::string& record) {
    return {{"session", "a"}, {"record", record}};
  }

  TemporaryFolder folder_;
  fs::path path_ = folder_ / "audit.jsonl";
  AuditLog log_{path_};
};

TEST_F(AuditLogTest, ProvesWhatItHasALineFor) {
  EXPECT_FALSE(log_.has_registration("a", "r1"));  // there is no log yet
  log_.append("registered", registration("r1"));
  log_.append("released", {{"session", "a"},
                           {"release", "f1"},
                           {"objects", nlohmann::ordered_json::array({{{"file", "x"}, {"sha256", "o1"}}})}});
  log_.append("sent", {{"session", "a"}, {"peer", "p"}, {"object", "o1"}});
  EXPECT_TRUE(log_.has_registration("a", "r1"));
  EXPECT_FALSE(log_.has_registration("b", "r1"));
  EXPECT_TRUE(log_.has_release("a", "f1"));
  EXPECT_FALSE(log_.has_release("b", "f1"));
  EXPECT_FALSE(log_.has_release("a", "f2"));
  EXPECT_EQ(log_.session_releasing("o1"), "a");
  EXPECT_FALSE(log_.session_releasing("o2"));
  EXPECT_TRUE(log_.has_sending("a", "p", "o1"));
  EXPECT_FALSE(log_.has_sending("a", "q", "o1"));
}

TEST_F(AuditLogTest, ALogThatIsLockedForLongIsAnError) {
  log_.append("registered", registration("r1"));
  const int other = ::open(path_.c_str(), O_RDWR | O_CLOEXEC);
  ASSERT_EQ(::flock(other, LOCK_EX), 0);
  EXPECT_THROW(log_.append("registered", registration("r2")), Error);
  ::close(other);
  log_.append("registered", registration("r3"));
  EXPECT_TRUE(log_.has_registration("a", "r3"));
}

TEST_F(AuditLogTest, TheNewestRegistrationCounts) {
  log_.append("registered", registration("r1"));
  EXPECT_TRUE(log_.has_registration("a", "r1"));
  AuditLog(path_).append("registered", registration("r2"));  // by another process
  EXPECT_FALSE(log_.has_registration("a", "r1"));
  EXPECT_TRUE(log_.has_registration("a", "r2"));
}

TEST_F(AuditLogTest, LinesThatWereTakenOutAreNoticed) {
  log_.append("registered", registration("r1"));
  const std::string earlier = text();
  log_.append("registered", registration("r2"));
  EXPECT_TRUE(log_.has_registration("a", "r2"));
  fs::resize_file(path_, earlier.size());
  EXPECT_THROW(log_.has_registration("a", "r1"), Error);
  fs::remove(path_);
  EXPECT_THROW(log_.has_registration("a", "r1"), Error);
  for (int n = 0; n < 3; ++n) AuditLog(path_).append("registered", registration("r1"));  // another file
  EXPECT_THROW(log_.has_registration("a", "r1"), Error);
  EXPECT_TRUE(AuditLog(path_).has_registration("a", "r1"));  // started again
}

TEST_F(AuditLogTest, LinesThatAreNoneAreSkipped) {
  log_.append("registered", registration("r1"));
  add("x\n[]\n7\nnull\n\n{\"event\":\"regis");
  EXPECT_TRUE(log_.has_registration("a", "r1"));
  log_.append("registered", registration("r2"));  // begins a line of its own
  EXPECT_TRUE(log_.has_registration("a", "r2"));
  EXPECT_THAT(text(), HasSubstr("{\"event\":\"regis\n{\"on\":"));
}

// A version of isoshift without links wrote it.
TEST_F(AuditLogTest, LinesOfOtherKindsProveNothing) {
  add("{\"event\": 7, \"session\": []}\n{\"event\":\"released\",\"objects\":7}\n");
  log_.append("registered", registration("r1"));
  EXPECT_TRUE(log_.has_registration("a", "r1"));
  EXPECT_FALSE(log_.has_been_released("a"));
}

TEST_F(AuditLogTest, ALineThatCannotBeWrittenIsKeptOnlyIfItsStepWasTaken) {
  fs::create_directory(path_);
  EXPECT_THROW(log_.append("released", {{"session", "never"}}), Error);
  log_.note("sent", {{"session", "happened"}});
  try {
    log_.write_kept();
    ADD_FAILURE() << "a folder was written";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("audit.jsonl: cannot be written: Is a directory"));
  }
  EXPECT_THROW(log_.has_release("a", "f1"), Error);
  fs::remove(path_);
  log_.write_kept();
  EXPECT_THAT(text(), HasSubstr("happened"));
  EXPECT_THAT(text(), Not(HasSubstr("never")));
}

TEST_F(AuditLogTest, AFullDiskLeavesNoPartOfALine) {
  log_.append("registered", registration("r1"));
  const std::string before = text();
  {
    const FileSizeLimit full(before.size() + 10);
    EXPECT_THROW(log_.append("registered", registration("r2")), Error);
    EXPECT_EQ(text(), before);
  }
  log_.append("registered", registration("r3"));
  EXPECT_TRUE(log_.has_registration("a", "r3"));
}

TEST_F(AuditLogTest, LinesOfManyProcessesDoNotMix) {
  constexpr int kThreads = 4, kLines = 50;
  {
    std::vector<std::jthread> writers;
    for (int n = 0; n < kThreads; ++n)
      writers.emplace_back([&] {
        AuditLog log(path_);
        for (int line = 0; line < kLines; ++line) log.append("registered", registration("r"));
      });
  }
  std::ifstream file(path_);
  int lines = 0;
  for (std::string line; std::getline(file, line); ++lines)
    EXPECT_THAT(line, HasSubstr("\"record\":\"r\",\"before\":"));
  EXPECT_EQ(lines, kThreads * kLines);
  EXPECT_THAT(chain_of(text()).broken, IsEmpty());
}

// The half of a letter in UTF-8 had kept the log locked.
TEST_F(AuditLogTest, ATextThatIsNoTextLocksNobodyOut) {
  log_.append("viewed", {{"by", std::string("a\xc3")}});
  AuditLog(path_).append("registered", registration("r1"));
  EXPECT_TRUE(log_.has_registration("a", "r1"));
}

}  // namespace
}  // namespace isoshift::audit_log_test
