// isoshift track: follows a moving target through X-rays over time.

#include <fmt/format.h>

#include <memory>

#include "base/error.h"
#include "base/json_file.h"
#include "cli/commands/commands.h"
#include "cli/switches/region_switches.h"
#include "cli/switches/rendering_switches.h"
#include "cli/switches/study_switches.h"
#include "workflow/track/track_study.h"

namespace isoshift {
namespace {

struct TrackFlags {
  TrackOptions track;
  std::string predictor = "rls";
  bool six_dof = false, json = false;
  double latency_ms = 300.0, together_ms = 50.0, budget_ms = 200.0;
};

void run_track(TrackFlags& flags, Console& console) {
  TrackOptions& options = flags.track;
  options.registration.settle();
  if (!options.phases.empty() && flags.predictor != "model")
    throw UsageError("--phases works only with --predictor model");
  if (!options.phases.empty() && options.phases.size() < 4)
    throw UsageError(fmt::format("--phases: {} folders, expected at least 4 phases of a cycle", options.phases.size()));
  options.tracking.latency_s = flags.latency_ms / 1000.0;
  options.tracking.predictor = predictor_kind_from(flags.predictor).value();
  options.tracking.dof = flags.six_dof ? Dof::kRigid : Dof::kTranslation;
  options.together_s = flags.together_ms / 1000.0;
  options.budget_s = flags.budget_ms / 1000.0;
  ConsoleObserver observer(console);
  const auto json = track_json(track_study(options, observer));
  if (flags.json)
    console.out << json_text(json);
  else
    console.out << track_text(json) << fmt::format("\nWritten to {}\n", options.output.string());
}

}  // namespace

// NOLINTNEXTLINE(readability-function-size): long because the command has many flags, one after the other
void add_track_command(CLI::App& app, Console& console, int&) {
  auto flags = std::make_shared<TrackFlags>();
  TrackOptions& options = flags->track;
  CLI::App* command =
      app.add_subcommand("track", "Track a moving target through a series of X-rays, and predict its motion");
  command->footer(
      "\nExample:\n  isoshift track breathing/ --structure Target -o track --truth breathing/truth.csv\n"
      "  isoshift track --ct CT --plan RTPLAN.dcm --structures RTSTRUCT.dcm --follow incoming/ --structure Target -o "
      "track\n\n"
      "Writes trace.csv, track.json and trace.svg. Positions are displacements of the target from where it was "
      "planned, mm,\n"
      "IEC 61217 fixed.");
  add_study_options(*command, options.study);
  command->add_option("-o,--output", options.output, "Folder for the results")->required()->type_name("FOLDER");
  command
      ->add_option(
          "--follow", options.follow,
          "Folder into which X-rays arrive; tracking ends when no X-ray has arrived for --idle, or with Ctrl-C")
      ->type_name("FOLDER");
  command->add_option("--idle", options.idle_s, "With --follow: end after this time without an X-ray")
      ->type_name("S")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("--predictor", flags->predictor, "How the target is predicted")
      ->check(CLI::IsMember(predictor_names()))
      ->capture_default_str();
  command->add_option("--phases", options.phases, "Folders of the phases of a 4D CT, in order, for --predictor model")
      ->type_name("FOLDER...");
  command
      ->add_option("--latency", flags->latency_ms,
                   "Time from the X-ray to the beam, over which the target is predicted")
      ->type_name("MS")
      ->check(CLI::Range(1.0, 2000.0))
      ->capture_default_str();
  command
      ->add_option("--together", flags->together_ms, "X-rays of several imagers within this time belong to one moment")
      ->type_name("MS")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command
      ->add_option("--budget", flags->budget_ms,
                   "Time that a moment may take; the summary says how many moments took no longer")
      ->type_name("MS")
      ->check(CLI::Range(0.1, 60000.0))
      ->capture_default_str();
  command->add_flag("--rigid", flags->six_dof, "Six degrees of freedom instead of the three translations");
  command->add_option("--box", options.tracking.box_mm, "Half the width of the search box around the expected position")
      ->type_name("MM")
      ->check(CLI::Range(2.0, 50.0))
      ->capture_default_str();
  command
      ->add_option("--tolerance", options.tolerance_mm,
                   "Mark the moments at which the target is farther off than this, so that the beam should wait")
      ->type_name("MM")
      ->check(CLI::Range(0.01, 1000.0));
  command->add_option("--truth", options.truth, "True positions (t_s, x, y, z), to print beside the result")
      ->type_name("CSV");
  command->add_flag("--overwrite", options.overwrite, "Replace an earlier output in that folder");
  command->add_flag("--json", flags->json, "Print track.json instead of a summary");
  options.registration.region.margin_mm = 2.0;  // what lies around a moving target does not move with it
  add_region_switches(*command, options.registration.region);
  add_rendering_options(*command, options.registration.rendering);
  command->callback([flags, &console] { run_track(*flags, console); });
}

}  // namespace isoshift
