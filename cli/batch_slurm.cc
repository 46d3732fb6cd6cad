#include "cli/batch_slurm.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstring>

#include "geometry/error.h"
#include "io/output_folder.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

// A word as a POSIX shell takes it.
std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

// What a program prints, both to its output and its errors. Throws Error where it cannot be run or fails.
std::string output_of(std::vector<std::string> words) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) throw Error(fmt::format("{}: {}", words.front(), std::strerror(errno)));
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  pid_t process = 0;
  const int failed = ::posix_spawnp(&process, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  std::string text;
  std::array<char, 512> buffer{};
  for (ssize_t count = 0; failed == 0 && (count = ::read(ends[0], buffer.data(), buffer.size())) > 0;)
    text.append(buffer.data(), static_cast<std::size_t>(count));
  ::close(ends[0]);
  if (failed != 0) throw Error(fmt::format("{}: cannot be run: {}", words.front(), std::strerror(failed)));
  int status = 0;
  ::waitpid(process, &status, 0);
  while (text.ends_with('\n')) text.pop_back();
  if (status != 0) throw Error(fmt::format("{}: {}", words.front(), text.empty() ? "failed" : text));
  return text;
}

std::string script(const std::string& name, const std::vector<std::string>& arguments, const std::string& directives,
                   const std::string& part) {
  std::string text = fmt::format("#!/bin/sh\n#SBATCH --job-name={}\n{}exec {}", name, directives,
                                 quoted(fs::read_symlink("/proc/self/exe").string()));
  for (const std::string& argument : arguments) text += " " + quoted(argument);
  return text + " " + part + "\n";
}

}  // namespace

std::string submit_to_slurm(const fs::path& folder, const std::vector<std::string>& arguments, int tasks) {
  const fs::path array = folder / "slurm.sh", merge = folder / "slurm-merge.sh";
  replace_text(array, script("isoshift", arguments, fmt::format("#SBATCH --array=1-{}\n", tasks),
                             fmt::format("--shard \"$SLURM_ARRAY_TASK_ID/{}\"", tasks)));
  replace_text(merge, script("isoshift-merge", arguments, "", "--merge"));
  // The identity of the job is the first word, before a cluster's name.
  const std::string answer =
      output_of({"sbatch", "--parsable", "--output=" + (folder / "slurm-%a.log").string(), array.string()});
  const std::string job = answer.substr(0, answer.find(';'));
  const std::string merged = output_of({"sbatch", "--parsable", "--dependency=afterany:" + job,
                                        "--output=" + (folder / "slurm-merge.log").string(), merge.string()});
  return fmt::format("submitted as job {} with {} tasks; {} merges them", job, tasks,
                     merged.substr(0, merged.find(';')));
}

}  // namespace isoshift
