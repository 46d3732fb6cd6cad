#include "base/process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <filesystem>
#include <iterator>

#include "base/error.h"

namespace isoshift::process_test {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

std::vector<std::string> shell(const std::string& script) { return {"sh", "-c", script}; }

std::ptrdiff_t open_descriptors() { return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), {}); }

// A process that waits for ever, and its number.
pid_t begin_waiting(Process& process) { return std::stoi(process.channel().line(Clock::now() + 1min).value()); }

TEST(Process, TellsWhatItPrintedAndHowItEnded) {
  const ProcessEnd end = run_to_end(shell("echo out; echo err >&2; exit 3"), 1min);
  EXPECT_EQ(end.status, 3);
  EXPECT_EQ(end.signal, 0);
  EXPECT_EQ(end.output, "out\nerr");
  EXPECT_FALSE(end.is_late);
  EXPECT_EQ(run_to_end(shell("kill -9 $$"), 1min).status, 128 + SIGKILL);
  EXPECT_EQ(run_to_end(shell("cat; echo end"), 1min).output, "end") << "its input did not end";
}

TEST(Process, AProgramThatIsNotThereIsAnError) {
  const auto before = open_descriptors();
  EXPECT_THROW(run_to_end({"isoshift-is-not-there"}, 1min), Error);
  EXPECT_THROW(Process({"isoshift-is-not-there"}, {.errors = ProcessOptions::Errors::kKept}), Error);
  EXPECT_EQ(open_descriptors(), before);
}

TEST(Process, ErrorsAreKeptApartFromMessages) {
  Process process(shell("echo message; echo error >&2; echo late >&2; kill -SEGV $$"),
                  {.errors = ProcessOptions::Errors::kKept});
  const ProcessEnd end = process.wait();
  EXPECT_EQ(end.output, "message");
  EXPECT_EQ(end.errors, "error\nlate");
  EXPECT_EQ(end.signal, SIGSEGV);
}

TEST(Process, OneThatIsLateIsKilledAndReaped) {
  const auto begin = Clock::now();
  Process process(shell("echo $$; echo begun; exec sleep 600"), {.limit = 300ms});
  const pid_t pid = begin_waiting(process);
  const ProcessEnd end = process.wait();
  EXPECT_TRUE(end.is_late);
  EXPECT_FALSE(end.is_from_outside());
  EXPECT_EQ(end.output, "begun");
  EXPECT_NE(::kill(pid, 0), 0) << "it still runs, or is a zombie";
  EXPECT_LT(Clock::now() - begin, 5min);
}

TEST(Process, ANewLimitTakesThePlaceOfTheFormer) {
  Process process(shell("exec sleep 600"), {.limit = 0ms});
  process.allow(10min);
  process.kill_if_late();
  EXPECT_FALSE(process.end(50ms));
  process.allow(std::nullopt);
  process.kill_if_late();
  EXPECT_FALSE(process.end(50ms));
  process.allow(0ms);
  process.kill_if_late();
  EXPECT_TRUE(process.wait().is_late);
}

TEST(Process, TellsKilledFromOutsideFromEndedByItself) {
  for (const char* killed : {"kill -9 $$", "kill -TERM $$", "exit 143"})
    EXPECT_TRUE(run_to_end(shell(killed), 1min).is_from_outside()) << killed;
  for (const char* ended : {"exit 0", "exit 1", "kill -SEGV $$", "kill -ABRT $$"})
    EXPECT_FALSE(run_to_end(shell(ended), 1min).is_from_outside()) << ended;
}

TEST(Process, NobodyOutlivesItsProcess) {
  const auto before = open_descriptors();
  pid_t pid = 0;
  {
    Process process(shell("echo $$; exec sleep 600"), {.errors = ProcessOptions::Errors::kKept});
    pid = begin_waiting(process);
    EXPECT_EQ(::kill(pid, 0), 0);
  }
  EXPECT_NE(::kill(pid, 0), 0) << "it still runs, or is a zombie";
  EXPECT_EQ(open_descriptors(), before);
}

TEST(Process, OneThatDoesNotListenIsKilled) {
  pid_t pid = 0;
  {
    Process process(shell("trap '' TERM; echo $$; while :; do sleep 0.1; done"));
    pid = begin_waiting(process);
  }
  EXPECT_NE(::kill(pid, 0), 0) << "it still runs, or is a zombie";
}

TEST(Process, InheritsNoDescriptorsButItsOwn) {
  constexpr int kOurs = 57;
  ASSERT_EQ(::dup2(STDERR_FILENO, kOurs), kOurs);  // without FD_CLOEXEC, as libraries open theirs
  const ProcessEnd end = run_to_end(shell("test -e /proc/$$/fd/2 && test ! -e /proc/$$/fd/57"), 1min);
  ::close(kOurs);
  EXPECT_EQ(end.status, 0);
}

TEST(Channel, TakesLinesAndBytesInTheOrderTheyCame) {
  Process process(shell("echo one; printf 'two\\nabc'; read word; printf \"def$word\"; sleep 600"));
  Channel& channel = process.channel();
  const auto until = Clock::now() + 1min;
  EXPECT_EQ(channel.line(until), "one");
  EXPECT_EQ(channel.line(until), "two");
  ASSERT_TRUE(channel.send("ghi\n", until));
  std::array<std::uint8_t, 9> bytes{};
  ASSERT_TRUE(channel.read(bytes, until));
  EXPECT_EQ(std::string(bytes.begin(), bytes.end()), "abcdefghi");
  EXPECT_EQ(channel.line(Clock::now() + 20ms), std::nullopt) << "nothing more is said";
}

TEST(Channel, SendingToNobodyIsNoSignal) {
  Process process(shell("exit 0"));
  process.wait();
  EXPECT_FALSE(process.channel().send(std::string(1 << 20, 'x'), Clock::now() + 1min));
}

TEST(Channel, SendingToOneThatDoesNotReadEnds) {
  Process process(shell("exec sleep 600"));
  EXPECT_FALSE(process.channel().send(std::string(1 << 24, 'x'), Clock::now() + 100ms));
}

}  // namespace
}  // namespace isoshift::process_test
