#include "cli/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "geometry/error.h"

namespace isoshift {
namespace {

std::filesystem::path program = "/proc/self/exe";

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() { ::close(number_); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

}  // namespace

const std::filesystem::path& this_program() { return program; }
void use_program(std::filesystem::path other) { program = std::move(other); }

pid_t start_child(const std::string& program, std::vector<std::string> words, const ChildStreams& streams) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  for (const auto& [from, to] : {std::pair(streams.in, STDIN_FILENO), std::pair(streams.out, STDOUT_FILENO),
                                 std::pair(streams.err, STDERR_FILENO)})
    if (from >= 0) posix_spawn_file_actions_adddup2(&actions, from, to);
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

ChildEnd run_child(std::vector<std::string> words, std::chrono::milliseconds limit) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw Error(fmt::format("{}: cannot be run: {}", words.front(), std::strerror(errno)));
  const Descriptor reading(ends[0]);
  pid_t process = 0;
  {
    const Descriptor writing(ends[1]);
    const std::string program = words.front();
    process = start_child(program, std::move(words), {.in = -1, .out = writing.number(), .err = writing.number()});
  }
  using Clock = std::chrono::steady_clock;
  const Clock::time_point deadline = Clock::now() + limit;
  ChildEnd end;
  std::array<char, 512> buffer{};
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    pollfd polled{.fd = reading.number(), .events = POLLIN, .revents = 0};
    const int ready = left.count() <= 0 ? 0 : ::poll(&polled, 1, static_cast<int>(left.count()));
    if (ready < 0 && errno == EINTR) continue;
    const ssize_t count = ready > 0 ? ::read(reading.number(), buffer.data(), buffer.size()) : 0;
    end.is_late = ready == 0;
    if (count <= 0) break;
    end.output.append(buffer.data(), static_cast<std::size_t>(count));
  }
  if (end.is_late) ::kill(process, SIGKILL);
  int status = 0;
  ::waitpid(process, &status, 0);
  end.status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  while (end.output.ends_with('\n')) end.output.pop_back();
  return end;
}

}  // namespace isoshift
