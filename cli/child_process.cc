#include "cli/child_process.h"

#include <fcntl.h>
#include <fmt/format.h>
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

}  // namespace

const std::filesystem::path& this_program() { return program; }
void use_program(std::filesystem::path other) { program = std::move(other); }

ChildEnd run_child(std::vector<std::string> words) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0)
    throw Error(fmt::format("{}: cannot be run: {}", words.front(), std::strerror(errno)));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  std::vector<char*> argv;
  argv.reserve(words.size() + 1);
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t process = 0;
  const int failed = ::posix_spawnp(&process, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  ChildEnd end;
  std::array<char, 512> buffer{};
  for (ssize_t count = 0; failed == 0 && (count = ::read(ends[0], buffer.data(), buffer.size())) != 0;)
    if (count > 0)
      end.output.append(buffer.data(), static_cast<std::size_t>(count));
    else if (errno != EINTR)
      break;
  ::close(ends[0]);
  if (failed != 0) throw Error(fmt::format("{}: cannot be run: {}", words.front(), std::strerror(failed)));
  int status = 0;
  ::waitpid(process, &status, 0);
  end.status = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
  while (end.output.ends_with('\n')) end.output.pop_back();
  return end;
}

}  // namespace isoshift
