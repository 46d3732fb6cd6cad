#include "workflow/batch/batch_slurm.h"

#include <fmt/format.h>

#include <utility>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/process.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes kLongestSubmission(5);

// A word as a POSIX shell takes it.
std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

// What sbatch answers. Throws Error where it refuses.
std::string submitted(std::vector<std::string> words) {
  words.insert(words.begin(), {"sbatch", "--parsable"});
  const ProcessEnd end = run_to_end(std::move(words), kLongestSubmission);
  if (end.is_late) throw Error(fmt::format("sbatch: did not end within {} minutes", kLongestSubmission.count()));
  if (end.status != 0) throw Error(fmt::format("sbatch: {}", end.output.empty() ? "failed" : end.output));
  return end.output.substr(0, end.output.find(';'));  // before a cluster's name
}

std::string script(const std::string& name, const std::vector<std::string>& arguments, const std::string& directives,
                   const std::string& part) {
  std::string text = fmt::format("#!/bin/sh\n#SBATCH --job-name={}\n{}exec {}", name, directives,
                                 quoted(fs::canonical(this_program()).string()));
  for (const std::string& argument : arguments) text += " " + quoted(argument);
  return text + " " + part + "\n";
}

}  // namespace

std::string submit_to_slurm(const fs::path& folder, const std::vector<std::string>& arguments, int tasks) {
  const fs::path array = folder / "slurm.sh", merge = folder / "slurm-merge.sh";
  replace_text(array, script("isoshift", arguments, fmt::format("#SBATCH --array=1-{}\n", tasks),
                             fmt::format("--shard \"$SLURM_ARRAY_TASK_ID/{}\"", tasks)));
  replace_text(merge, script("isoshift-merge", arguments, "", "--merge"));
  const std::string job = submitted({"--output=" + (folder / "slurm-%a.log").string(), array.string()});
  const std::string merged =
      submitted({"--dependency=afterany:" + job, "--output=" + (folder / "slurm-merge.log").string(), merge.string()});
  return fmt::format("submitted as job {} with {} tasks; job {} merges them", job, tasks, merged);
}

}  // namespace isoshift
