// isoshift evaluate: many registrations from published starts, their errors against a known truth.

#include <fmt/format.h>

#include <array>
#include <memory>

#include "base/error.h"
#include "cli/commands/commands.h"
#include "cli/switches/registration_switches.h"
#include "cli/switches/study_switches.h"
#include "workflow/evaluate/evaluate_study.h"
#include "workflow/evaluate/table2.h"
#include "workflow/evaluate/table2_configurations.h"
#include "workflow/register/truth.h"

namespace isoshift {
namespace {

struct EvaluateFlags {
  EvaluateOptions evaluation;
  std::string series = "bins";
  std::optional<int> starts;
  std::optional<double> distance_mm;
  std::uint64_t start_seed = 1;
  std::filesystem::path truth;
  std::vector<std::filesystem::path> table;
  bool table2 = false;
  std::vector<std::string> only;  // configurations of Table 2; empty: all
};

StartProtocol protocol_of(const EvaluateFlags& flags) {
  StartProtocol protocol = flags.series == "paper" ? StartProtocol::paper() : StartProtocol{};
  protocol.count = flags.starts.value_or(protocol.count);
  protocol.distance_mm = flags.distance_mm.value_or(protocol.distance_mm);
  protocol.seed = flags.start_seed;
  protocol.check();
  return protocol;
}

void print_table(const std::vector<std::filesystem::path>& paths, Console& console) {
  std::vector<std::pair<std::string, EvaluationSummary>> rows;
  for (const std::filesystem::path& path : paths) {
    const EvaluationFolder folder(path);
    rows.emplace_back(path.filename().empty() ? path.parent_path().filename().string() : path.filename().string(),
                      summarized(folder.runs(), folder.judged_by_mrpd()));
  }
  console.out << evaluation_table(rows);
}

void run_evaluate(EvaluateFlags& flags, Console& console) {
  if (!flags.table.empty()) return print_table(flags.table, console);
  EvaluateOptions& options = flags.evaluation;
  if (flags.truth.empty() || options.output.empty())
    throw UsageError("an evaluation needs --truth and -o (or --table to look at earlier ones)");
  options.protocol = protocol_of(flags);
  options.truth = read_setup_error(flags.truth);
  options.body_truths = read_body_truths(flags.truth);
  options.truth_file = flags.truth;
  Notes notes;
  ConsoleObserver observer(console);
  if (flags.table2) {
    const std::string table = evaluate_table2(options, flags.only, notes, observer);
    print_warnings(notes.warnings, console);
    console.out << table;
    return;
  }
  options.registration.settle();
  const EvaluationFolder folder = evaluate_study(options, notes, observer);
  print_warnings(notes.warnings, console);
  console.out << evaluation_table(
      {{options.output.filename().string(), summarized(folder.runs(), folder.judged_by_mrpd())}});
}

// What every configuration of Table 2 says itself is not asked for.
void add_table2_flags(CLI::App& command, EvaluateFlags& flags) {
  constexpr std::array kSaidByConfigurations = {"--series",    "--distance",       "--preset",   "--similarity",
                                                "--optimizer", "--pixel-fraction", "--renderer", "--block-edge",
                                                "--wobble",    "--check-vertebrae"};
  CLI::Option* table2 = command.add_flag("--table2", flags.table2,
                                         "Evaluate every configuration of the founding paper's Table 2, each in a "
                                         "folder of its own; --starts is then the most of each");
  for (const char* flag : kSaidByConfigurations) table2->excludes(command.get_option(flag));
  std::vector<std::string> names;
  for (const Table2Configuration& configuration : table2_configurations()) names.emplace_back(configuration.name);
  command.add_option("--only", flags.only, "Of Table 2 only this configuration; may be repeated")
      ->check(CLI::IsMember(names))
      ->needs(table2);
}

}  // namespace

void add_evaluate_command(CLI::App& app, Console& console, int&) {
  auto flags = std::make_shared<EvaluateFlags>();
  EvaluateOptions& options = flags->evaluation;
  CLI::App* command = app.add_subcommand("evaluate", "Measure the accuracy of registration from many starts");
  command->footer(
      "\nExample:\n  isoshift evaluate exported/ --truth exported/truth.json -o evaluation\n"
      "  isoshift evaluate --table evaluation other_evaluation\n\n"
      "Writes runs.csv, bodies.csv, summary.json, success.svg and errors.svg. The same command continues an\n"
      "evaluation that was stopped. The protocol is that of van de Kraats et al. (2005): docs/evaluation.md.");
  add_study_options(*command, options.study);
  command->add_option("--truth", flags->truth, "truth.json of the study: the true setup error")->type_name("FILE");
  command
      ->add_option("--target", options.target, "The structure whose error counts, or isocenter [what the plan names]")
      ->type_name("NAME");
  command->add_option("-o,--output", options.output, "Folder for the results")->type_name("FOLDER");
  command
      ->add_option("--series", flags->series,
                   "bins: 200 starts spread over 0 to 20 mm of mTRE; paper: 150 starts 25 mm away")
      ->check(CLI::IsMember({"bins", "paper"}))
      ->capture_default_str();
  command->add_option("--starts", flags->starts, "How many starts")->type_name("N");
  command->add_option("--distance", flags->distance_mm, "bins: the largest mTRE at the start; paper: the translation")
      ->type_name("MM");
  command->add_option("--start-seed", flags->start_seed, "Seed of the random starts")->capture_default_str();
  command
      ->add_option(
          "--jobs", options.jobs,
          "Registrations at the same time, each on one thread [one per core]; with 1, a registration uses all cores: "
          "use this to measure its time")
      ->check(CLI::Range(1, 256));
  command->add_option("--table", flags->table, "Print a table of evaluations made earlier")->type_name("FOLDER...");
  add_registration_switches(*command, options.registration);
  add_table2_flags(*command, *flags);
  command->callback([flags, &console] { run_evaluate(*flags, console); });
}

}  // namespace isoshift
