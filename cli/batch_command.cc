// isoshift batch: registers many studies.

#include <fmt/format.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <thread>

#include "cli/batch_folder.h"
#include "cli/batch_manifest.h"
#include "cli/batch_slurm.h"
#include "cli/batch_summary.h"
#include "cli/batch_workers.h"
#include "cli/commands.h"
#include "cli/graceful_end.h"
#include "cli/register_command.h"
#include "geometry/error.h"
#include "io/output_folder.h"

namespace isoshift {
namespace {

struct BatchOptions {
  RegisterOptions each;  // switches for all cases
  std::filesystem::path cases, output;
  int jobs = 1, slurm_tasks = 0;
  std::string shard;
  bool scan = false, merge = false, worker = false, json = false;

  std::vector<std::string> kept;  // what every run of this batch must say alike, as on the command line
};

// Those that say which part of a batch runs, and how it is told.
const std::set<std::string> kOfOneRun = {"cases", "output", "jobs",   "shard", "merge",
                                         "slurm", "scan",   "worker", "json",  "help"};

std::vector<std::string> kept_options(const CLI::App& command) {
  std::vector<std::string> kept;
  for (const CLI::Option* option : command.get_options()) {
    const std::string name = option->get_single_name();
    if (option->count() == 0 || kOfOneRun.contains(name)) continue;
    for (const std::string& result : option->results())
      kept.push_back(option->get_expected_max() == 0 ? "--" + name : fmt::format("--{}={}", name, result));
  }
  return kept;
}

Shard shard_from(const std::string& text) {
  Shard shard;
  char slash = 0;
  std::istringstream words(text);
  if (!(words >> shard.number >> slash >> shard.count) || slash != '/' || !words.eof() || shard.number < 1 ||
      shard.number > shard.count)
    throw UsageError(fmt::format("--shard {}: expected I/N, I from 1 to N", text));
  return shard;
}

// Cases of one CT stay together.
std::vector<BatchCase> cases_of(const Shard& shard, std::vector<BatchCase> cases) {
  std::multimap<std::string, BatchCase> by_ct;  // cases of one CT keep their order
  for (BatchCase& one : cases) by_ct.emplace(one.ct_key(), std::move(one));
  std::ranges::transform(by_ct, cases.begin(), [](auto& entry) { return std::move(entry.second); });
  const auto begin = [&](int number) {
    return static_cast<std::ptrdiff_t>(cases.size() * static_cast<std::size_t>(number) /
                                       static_cast<std::size_t>(shard.count));
  };
  return {cases.begin() + begin(shard.number - 1), cases.begin() + begin(shard.number)};
}

class Batch {
 public:
  Batch(const BatchOptions& options, Console& console) : options_(options), console_(console) {}

  int run() {
    if (options_.scan) return scan();
    std::vector<BatchCase> cases = read_cases();
    BatchFolder folder(options_.output, options_.kept);
    if (std::filesystem::is_directory(options_.cases))
      replace_text(folder.path() / "manifest.csv", manifest_csv(cases));
    if (options_.slurm_tasks > 0) {
      console_.out << submit_to_slurm(std::filesystem::absolute(folder.path()), arguments(), options_.slurm_tasks)
                   << "\n";
      return kExitAccepted;
    }
    if (options_.merge) return summarize(folder, cases);
    const Shard shard = options_.shard.empty() ? Shard() : shard_from(options_.shard);
    if (shard.count > 1) cases = cases_of(shard, std::move(cases));
    const ShardLock lock = folder.work_on(shard, cases);
    if (!register_all(folder, cases)) {
      console_.err << "ended before all cases were registered; the same command goes on\n";
      return kExitFailed;
    }
    return shard.count > 1 ? say(summary_of(folder, cases)) : summarize(folder, cases);
  }

  // One of the processes that --jobs starts.
  void serve() {
    const std::vector<BatchCase> cases = read_cases();
    const BatchFolder folder(options_.output, options_.kept);
    const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
    const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                      std::max(1U, cores / static_cast<unsigned>(options_.jobs)));
    SharedWork shared;
    std::ostringstream nobody;  // all is in the result
    Console quiet{.out = nobody, .err = nobody};
    serve_cases([&](const std::string& name) {
      const auto one = std::ranges::find(cases, name, &BatchCase::name);
      if (one == cases.end() || folder.has_ended(name)) return;
      try {
        RegisterOptions registered = options_.each;
        registered.study = one->options(options_.each.study);
        if (!one->anatomy.empty()) registered.anatomy = one->anatomy;
        registered.output = folder.folder_of(name);
        register_study(registered, shared, quiet);
      } catch (const WriteError&) {
        throw;  // the case is as good as before
      } catch (const std::exception& error) {
        folder.fail(name, error.what());
      }
    });
  }

 private:
  int scan() const {
    const std::vector<BatchCase> cases = scanned_cases();
    replace_text(options_.output, manifest_csv(cases));
    console_.out << fmt::format("{}: {} cases\n", options_.output.string(), cases.size());
    return kExitAccepted;
  }

  std::vector<BatchCase> read_cases() const {
    if (!std::filesystem::is_directory(options_.cases)) return read_manifest(options_.cases);
    // What was scanned once is what workers and shards register, too.
    if (const auto scanned = options_.output / "manifest.csv";
        (options_.worker || options_.merge || !options_.shard.empty()) && std::filesystem::exists(scanned))
      return read_manifest(scanned);
    return scanned_cases();
  }

  std::vector<BatchCase> scanned_cases() const {
    Notes notes;
    std::vector<BatchCase> cases = scan_cases(options_.cases, !options_.each.study.machine.empty(), notes);
    print_warnings(notes.warnings, console_);
    return cases;
  }

  std::vector<std::string> arguments() const {
    std::vector<std::string> words = {"batch",    std::filesystem::absolute(options_.cases).string(),
                                      "--output", std::filesystem::absolute(options_.output).string(),
                                      "--jobs",   fmt::format("{}", options_.jobs)};
    words.insert(words.end(), options_.kept.begin(), options_.kept.end());
    return words;
  }

  // False where it was ended before.
  bool register_all(const BatchFolder& folder, const std::vector<BatchCase>& cases) {
    std::vector<BatchJob> jobs;
    for (const BatchCase& one : cases)
      if (!folder.has_ended(one.name)) jobs.push_back({.name = one.name, .ct_key = one.ct_key()});
    if (jobs.size() < cases.size())
      console_.err << fmt::format("{} of {} cases have been registered before\n", cases.size() - jobs.size(),
                                  cases.size());
    std::vector<std::string> of_worker = arguments();
    of_worker.emplace_back("--worker");
    const GracefulEnd end;
    const std::size_t total = jobs.size();
    std::size_t ended = 0;
    ProgressBar bar(console_, fmt::format("Registering {}", total));
    run_in_workers(
        std::move(jobs), options_.jobs, of_worker,
        [&](const std::string& name, const std::optional<std::string>& death) {
          if (death) folder.fail(name, *death);
          if (!folder.has_ended(name)) folder.fail(name, "the worker said that it ended, and left no result");
          bar.update(++ended, total);
        },
        [&] { return end.is_asked_for(); });
    return ended == total;
  }

  int summarize(const BatchFolder& folder, const std::vector<BatchCase>& cases) {
    const BatchSummary summary = summary_of(folder, cases);
    write_summary(folder, summary);
    const int status = say(summary);
    if (!options_.json)
      console_.out << fmt::format("\nWritten to {}: index.html, summary.csv, summary.json\n", folder.path().string());
    return summary.open() > 0 ? kExitFailed : status;
  }

  // Whether all, some or none were accepted.
  int say(const BatchSummary& summary) {
    console_.out << (options_.json ? summary_json(summary) : summary_text(summary));
    if (summary.accepted() == summary.cases.size()) return kExitAccepted;
    return summary.accepted() > 0 ? kExitReview : kExitRejected;
  }

  const BatchOptions& options_;
  Console& console_;
};

}  // namespace

void add_batch_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<BatchOptions>();
  CLI::App* command = app.add_subcommand("batch", "Register many studies");
  command->footer(
      "\nExample:\n  isoshift batch exported/ -o results            # every session of X-rays below the folder\n"
      "  isoshift batch --scan exported/ -o cases.csv   # only write down which files would make a case\n"
      "  isoshift batch cases.csv -o results --jobs 4\n\n"
      "Writes a folder per case, index.html, patients.html, summary.csv and summary.json. The same command goes on\n"
      "where one was stopped.\n"
      "Exit status: 0 all accepted, 1 failed or stopped, 2 usage, 3 some accepted, 4 none.");
  command
      ->add_option("cases", options->cases,
                   "Folder with the files of many patients, or a manifest: CSV or JSON lines (docs/commands/batch.md)")
      ->required()
      ->type_name("PATH");
  command->add_option("-o,--output", options->output, "Folder for the results; with --scan the manifest to write")
      ->required()
      ->type_name("PATH");
  command->add_flag("--scan", options->scan, "Only write the manifest of what is in the folder");
  command->add_option("--jobs", options->jobs, "Cases at the same time, each in a process of its own")
      ->type_name("N")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  const char* parts = "Beyond one machine";
  command->add_option("--shard", options->shard, "Only part I of N; --merge makes the summary of all")
      ->type_name("I/N")
      ->group(parts);
  command->add_flag("--merge", options->merge, "Only the summary of what has been registered")->group(parts);
  command->add_option("--slurm", options->slurm_tasks, "Submit N shards as a Slurm job array, and the merge after it")
      ->type_name("N")
      ->check(CLI::Range(1, 100000))
      ->group(parts);
  command->add_flag("--worker", options->worker)->group("");  // not for people
  command->add_flag("--json", options->json, "Print summary.json instead of its figures");
  add_result_options(*command, options->each);
  add_study_switches(*command, options->each.study);
  add_registration_flags(*command, options->each.flags);
  command->callback([options, command, &console, &exit_status] {
    options->each.flags.settle();
    options->kept = kept_options(*command);
    Batch batch(*options, console);
    if (options->worker)
      batch.serve();
    else
      exit_status = batch.run();
  });
}

}  // namespace isoshift
