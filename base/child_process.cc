#include "base/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "base/error.h"

namespace isoshift {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

std::filesystem::path own_program = "/proc/self/exe";

}  // namespace

const std::filesystem::path& this_program() { return own_program; }
void use_program(std::filesystem::path other) { own_program = std::move(other); }

pid_t start_child(const std::string& program, std::vector<std::string> words, const ChildStreams& streams) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const auto& [from, to] : {std::pair(streams.in, STDIN_FILENO), std::pair(streams.out, STDOUT_FILENO),
                                 std::pair(streams.err, STDERR_FILENO)})
    if (from >= 0) posix_spawn_file_actions_adddup2(&actions, from, to);
  ::posix_spawn_file_actions_addclosefrom_np(&actions, STDERR_FILENO + 1);  // libraries' sockets
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t process = 0;
  const int failed = ::posix_spawnp(&process, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) throw Error(fmt::format("{}: cannot be run: {}", program, std::strerror(failed)));
  return process;
}

Child::Child(std::vector<std::string> words, std::chrono::milliseconds limit) : deadline_(Clock::now() + limit) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw Error(fmt::format("{}: cannot be run: {}", words.front(), std::strerror(errno)));
  try {
    const std::string program = words.front();
    process_ = start_child(program, std::move(words), {.in = -1, .out = ends[1], .err = ends[1]});
  } catch (const Error&) {
    ::close(ends[0]);
    ::close(ends[1]);
    throw;
  }
  ::close(ends[1]);
  output_ = ends[0];
}

Child::~Child() {
  ::close(output_);
  if (process_ == 0) return;
  ::kill(process_, SIGTERM);
  ::waitpid(process_, nullptr, 0);
}

bool Child::hear(Clock::time_point until) {
  for (;;) {
    const auto left = std::max(std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()), 0ms);
    pollfd polled{.fd = output_, .events = POLLIN, .revents = 0};
    const int ready = ::poll(&polled, 1, static_cast<int>(left.count()));
    if (ready < 0 && errno == EINTR) continue;
    if (ready == 0) return true;
    std::array<char, 512> buffer{};
    const ssize_t count = ::read(output_, buffer.data(), buffer.size());
    if (count <= 0) return false;
    end_.output.append(buffer.data(), static_cast<std::size_t>(count));
  }
}

std::optional<ChildEnd> Child::end(std::chrono::milliseconds patience) {
  if (process_ != 0) {
    if (hear(std::min(Clock::now() + patience, deadline_))) {
      if (Clock::now() < deadline_) return std::nullopt;
      end_.is_late = true;
      ::kill(process_, SIGKILL);
    }
    int status = 0;
    ::waitpid(std::exchange(process_, 0), &status, 0);
    end_.status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    while (end_.output.ends_with('\n')) end_.output.pop_back();
  }
  return end_;
}

ChildEnd run_child(std::vector<std::string> words, std::chrono::milliseconds limit) {
  Child child(std::move(words), limit);
  for (;;)
    if (std::optional<ChildEnd> end = child.end(limit)) return *std::move(end);
}

}  // namespace isoshift
