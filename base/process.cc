#include "base/process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <thread>
#include <utility>

#include "base/error.h"

namespace isoshift {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
constexpr std::chrono::seconds kLongestFarewell(10);  // from the signal that asks a program to end until SIGKILL

std::filesystem::path own_program = "/proc/self/exe";

std::string text_of(int file) {
  std::string text;
  std::array<char, 4096> buffer{};
  ssize_t count = 0;
  while ((count = ::pread(file, buffer.data(), buffer.size(), static_cast<off_t>(text.size()))) > 0)
    text.append(buffer.data(), static_cast<std::size_t>(count));
  return text;
}

void remove_last_end(std::string& text) {
  while (text.ends_with('\n')) text.pop_back();
}

}  // namespace

const std::filesystem::path& this_program() { return own_program; }
void use_program(std::filesystem::path other) { own_program = std::move(other); }

int parent_socket() {
  ::dup2(STDERR_FILENO, STDOUT_FILENO);
  return STDIN_FILENO;
}

bool ProcessEnd::is_from_outside() const {
  return !is_late && (signal == SIGKILL || signal == SIGTERM || status == 128 + SIGTERM);
}

Process::Process(std::vector<std::string> words, const ProcessOptions& options)
    : end_signal_(options.end_signal), channel_(start(std::move(words), options)) {
  allow(options.limit);
}

// Returns this program's end of the socket that is the child's standard input and output.
int Process::start(std::vector<std::string> words, const ProcessOptions& options) {
  using enum ProcessOptions::Errors;
  const std::string program = options.program.empty() ? words.front() : options.program.string();
  std::array<int, 2> ends{-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0)
    throw Error(fmt::format("{}: cannot be run: {}", program, std::strerror(errno)));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  if (options.errors == kWithOutput) posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  if (options.errors == kKept) {
    errors_.file = ::memfd_create("errors", MFD_CLOEXEC);
    posix_spawn_file_actions_adddup2(&actions, errors_.file, STDERR_FILENO);
  }
  if (options.errors == kDropped) posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  ::posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);  // libraries' sockets
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int failed = ::posix_spawnp(&process_, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  if (failed == 0) return ends[0];
  ::close(ends[0]);
  throw Error(fmt::format("{}: cannot be run: {}", program, std::strerror(failed)));
}

Process::Errors::~Errors() {
  if (file >= 0) ::close(file);
}

Process::~Process() {
  if (process_ == 0) return;
  ::kill(process_, end_signal_);
  if (has_ended_by(Clock::now() + kLongestFarewell)) return;
  ::kill(process_, SIGKILL);
  has_ended_by(Channel::Time::max());
}

void Process::allow(std::optional<std::chrono::milliseconds> limit) {
  deadline_ = limit ? Clock::now() + *limit : Channel::Time::max();
}

void Process::kill_if_late() {
  if (process_ == 0 || end_.is_late || Clock::now() < deadline_) return;
  end_.is_late = true;
  ::kill(process_, SIGKILL);
}

bool Process::has_ended_by(Channel::Time until) {
  int status = 0;
  for (;;) {
    const pid_t ended = ::waitpid(process_, &status, until == Channel::Time::max() ? 0 : WNOHANG);
    if (ended == process_ || (ended < 0 && errno != EINTR)) break;
    if (ended == 0 && Clock::now() >= until) return false;
    if (ended == 0) std::this_thread::sleep_for(1ms);
  }
  process_ = 0;
  end_.signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  end_.status = end_.signal != 0 ? 128 + end_.signal : WEXITSTATUS(status);
  return true;
}

std::optional<ProcessEnd> Process::end(std::chrono::milliseconds patience) {
  if (process_ != 0) {
    const Channel::Time until = std::min(Clock::now() + patience, deadline_);
    auto heard = Channel::Heard::kSomething;
    while (heard == Channel::Heard::kSomething) heard = channel_.hear(until);
    if (heard == Channel::Heard::kNothing || !has_ended_by(until)) {
      kill_if_late();
      if (!end_.is_late) return std::nullopt;
      has_ended_by(Channel::Time::max());
    }
  }
  ProcessEnd end = end_;
  end.output = channel_.heard();
  if (errors_.file >= 0) end.errors = text_of(errors_.file);
  remove_last_end(end.output);
  remove_last_end(end.errors);
  return end;
}

ProcessEnd Process::wait() {
  for (;;)
    if (std::optional<ProcessEnd> end = this->end(1s)) return *std::move(end);
}

ProcessEnd run_to_end(std::vector<std::string> words, std::chrono::milliseconds limit) {
  Process process(std::move(words), {.limit = limit});
  process.channel().end_sending();
  return process.wait();
}

}  // namespace isoshift
