// isoshift batch: registers many studies.

#include <fmt/format.h>

#include <memory>
#include <set>
#include <sstream>

#include "base/error.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "cli/switches/options_as_typed.h"
#include "cli/switches/registration_switches.h"
#include "cli/switches/study_switches.h"
#include "workflow/batch/batch.h"
#include "workflow/batch/batch_slurm.h"

namespace isoshift {
namespace {

struct BatchFlags {
  BatchOptions batch;
  int slurm_tasks = 0;
  std::string shard;
  bool scan = false, merge = false, json = false;
};

// The options that say which cases of a batch run, and how the outcome is printed.
const std::set<std::string> kOfOneRun = {"cases", "output", "jobs", "shard", "merge", "slurm", "scan", "json", "help"};

Shard shard_from(const std::string& text) {
  Shard shard;
  char slash = 0;
  std::istringstream words(text);
  if (!(words >> shard.number >> slash >> shard.count) || slash != '/' || !words.eof() || shard.number < 1 ||
      shard.number > shard.count)
    throw UsageError(fmt::format("--shard {}: expected I/N, I from 1 to N", text));
  return shard;
}

// Whether all, some or none were accepted.
int print(const BatchSummary& summary, bool as_json, Console& console) {
  console.out << (as_json ? summary_json(summary) : summary_text(summary));
  if (summary.accepted() == summary.cases.size()) return kExitAccepted;
  return summary.accepted() > 0 ? kExitReview : kExitRejected;
}

int scan(const BatchOptions& options, Console& console) {
  ConsoleObserver observer(console);
  const std::vector<BatchCase> cases = cases_of(options, observer);
  write_text(options.output, manifest_csv(cases));
  console.out << fmt::format("{}: {} cases\n", options.output.string(), cases.size());
  return kExitAccepted;
}

int summarize(const Batch& batch, bool as_json, Console& console) {
  const BatchSummary summary = batch.summary();
  write_summary(batch.folder(), summary);
  const int status = print(summary, as_json, console);
  if (!as_json)
    console.out << fmt::format("\nWritten to {}: index.html, summary.csv, summary.json\n",
                               batch.folder().path().string());
  return summary.open() > 0 ? kExitFailed : status;
}

int run_batch(BatchFlags& flags, Console& console) {
  BatchOptions& options = flags.batch;
  if (!flags.shard.empty()) options.shard = shard_from(flags.shard);
  options.takes_earlier_scan = flags.merge || options.shard;
  if (flags.scan) return scan(options, console);
  ConsoleObserver observer(console);
  Batch batch(options, observer);
  if (flags.slurm_tasks > 0) {
    console.out << submit_to_slurm(std::filesystem::absolute(batch.folder().path()), batch.arguments(),
                                   flags.slurm_tasks)
                << "\n";
    return kExitAccepted;
  }
  if (flags.merge) return summarize(batch, flags.json, console);
  if (!batch.run()) {
    observer.say("ended before all cases were registered; the same command continues the batch");
    return kExitFailed;
  }
  return options.shard && options.shard->count > 1 ? print(batch.summary(), flags.json, console)
                                                   : summarize(batch, flags.json, console);
}

}  // namespace

void add_batch_command(CLI::App& app, Console& console, int& exit_status) {
  auto flags = std::make_shared<BatchFlags>();
  BatchOptions& options = flags->batch;
  CLI::App* command = app.add_subcommand("batch", "Register many studies");
  command->footer(
      "\nExample:\n  isoshift batch exported/ -o results            # every session of X-rays below the folder\n"
      "  isoshift batch --scan exported/ -o cases.csv   # only list the cases and their files\n"
      "  isoshift batch cases.csv -o results --jobs 4\n\n"
      "Writes a folder per case, index.html, patients.html, summary.csv and summary.json. The same command\n"
      "continues a batch that was stopped.\n"
      "Exit status: 0 all accepted, 1 failed or stopped, 2 usage, 3 some accepted, 4 none.");
  command
      ->add_option("cases", options.cases,
                   "Folder with the files of many patients, or a manifest: CSV or JSON lines (docs/commands/batch.md)")
      ->required()
      ->type_name("PATH");
  command->add_option("-o,--output", options.output, "Folder for the results; with --scan the manifest to write")
      ->required()
      ->type_name("PATH");
  command->add_flag("--scan", flags->scan, "Only write a manifest of the cases in the folder");
  command->add_option("--jobs", options.jobs, "Cases that are registered at the same time, each in its own process")
      ->type_name("N")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  const char* parts = "Beyond one machine";
  command
      ->add_option("--shard", flags->shard, "Register only shard I of N; --merge then makes the summary of all shards")
      ->type_name("I/N")
      ->group(parts);
  command->add_flag("--merge", flags->merge, "Only make the summary of the cases that have been registered")
      ->group(parts);
  command->add_option("--slurm", flags->slurm_tasks, "Submit N shards as a Slurm job array, and the merge after it")
      ->type_name("N")
      ->check(CLI::Range(1, 100000))
      ->group(parts);
  command->add_flag("--json", flags->json, "Print summary.json instead of a summary in words");
  add_result_options(*command, options.each);
  add_study_switches(*command, options.each.study);
  add_registration_switches(*command, options.each.registration);
  command->callback([flags, command, &console, &exit_status] {
    flags->batch.each.registration.settle();
    flags->batch.kept = options_as_typed(*command, kOfOneRun);
    exit_status = run_batch(*flags, console);
  });
}

}  // namespace isoshift
