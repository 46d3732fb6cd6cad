#include "cli/commands/register_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <memory>

#include "base/error.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "cli/switches/registration_switches.h"
#include "cli/switches/study_switches.h"
#include "geometry/patient_setup.h"
#include "io/objects/spatial_registration.h"
#include "io/report/formats.h"
#include "io/report/result_folder.h"
#include "setup/couch_shift.h"
#include "workflow/register/setup_result_of.h"
#include "workflow/register/truth.h"

namespace isoshift {

int exit_status_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAccepted: return kExitAccepted;
    case Verdict::kReview: return kExitReview;
    case Verdict::kRejected: return kExitRejected;
  }
  return kExitFailed;
}

namespace {

// Where the target's center was planned.
Eigen::Vector3d planned_target_patient_mm(const SetupResult& report) {
  const auto position = patient_position_from(report.patient_position);
  if (!position || !report.target) return report.isocenter_patient_mm;
  return planned_room_from_patient(*position, report.table, report.isocenter_patient_mm).inverse() *
         report.target->center_room_mm;
}

}  // namespace

int run_register(RegisterOptions options, bool as_json, Console& console) {
  options.registration.settle();
  std::optional<Eigen::Isometry3d> truth;
  std::vector<BodyTruth> body_truths;
  if (!options.truth.empty()) {
    truth = read_setup_error(options.truth);
    body_truths = read_body_truths(options.truth);
  }
  const bool names_target = !options.target.empty();
  SharedWork none;
  ConsoleObserver observer(console);
  const SetupResult report = register_study(options, none, observer);
  print_warnings(report.warnings, console);
  console.out << (as_json ? json_report(report) : text_report(report_page(report)));
  if (!as_json) {
    if (truth && names_target)
      truth = truth_at(planned_target_patient_mm(report), *truth, report.isocenter_patient_mm, body_truths);
    if (truth) console.out << "\n" << compared_with_truth(report.setup_error, *truth);
    console.out << fmt::format("\nWritten to {}\n",
                               std::filesystem::absolute(options.output).lexically_normal().string());
  }
  return exit_status_of(report.verdict());
}

void add_result_options(CLI::App& command, RegisterOptions& options) {
  command
      .add_option("--site", options.site,
                  "Site file: action levels, the couch's degrees of freedom and scale (docs/site-file.md)")
      ->type_name("FILE");
  command.add_option("--anatomy", options.anatomy, "Anatomy of the site file whose action level and target apply")
      ->type_name("NAME");
  command
      .add_option("--target", options.target,
                  "The structure that the setup must bring right, or isocenter [what the site file or the plan names]")
      ->type_name("NAME");
  command.add_flag("--write-reg-for-review", options.write_reg_for_review,
                   "Also write the registration object of a result for review, marked as not accepted");
  command.add_flag(
      "--accept-unobservable", options.accept_unobservable,
      "Also write the registration object if the views cannot measure a direction; the setup error along it is "
      "then taken as 0");
  command
      .add_option_function<std::string>(
          "--source-for",
          [&options](const std::string& name) {
            options.source = name == "treatment" ? RegistrationSource::kTreatment : RegistrationSource::kIecFixed;
          },
          "Source frame of the registration object: treatment, with the axes of the patient as planned, or the room's, "
          "IEC 61217 fixed")
      ->check(CLI::IsMember({"treatment", "iec-fixed"}))
      ->default_str("treatment");
}

void add_start_option(CLI::App& command, RegisterOptions& options) {
  auto* start =
      command
          .add_option("--start", options.start,
                      "Begin at the setup error in this file instead of the planned pose: a result.json, truth.json, a "
                      "pose set by hand, a Spatial Registration of any program, or an ITK transform (.tfm)")
          ->type_name("FILE");
  add_source_isocenter_option(command, options.source_isocenter)->needs(start);
}

RegisterOptions register_options_from(const std::vector<std::string>& flags) {
  CLI::App app;
  RegisterOptions options;
  add_result_options(app, options);
  add_study_switches(app, options.study);
  add_registration_switches(app, options.registration);
  try {
    app.parse(std::vector<std::string>(flags.rbegin(), flags.rend()));
  } catch (const CLI::ParseError& error) {
    throw UsageError(error.what());
  }
  options.registration.settle();
  return options;
}

void add_register_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<RegisterOptions>();
  CLI::App* command =
      app.add_subcommand("register", "Find the setup error in an exported study, and the couch shift that undoes it");
  command->footer(
      "\nExample:\n  isoshift register exported/ -o result\n"
      "  isoshift register images/ --ct planning_ct/ --plan RTPLAN.dcm -o result --couch-angle 0\n\n"
      "Writes the report (report.pdf, .html, .txt, .csv, and .dcm: Encapsulated PDF), result.json, pictures per view\n"
      "and, for an accepted result, spatial_registration.dcm.\n"
      "Exit status: 0 accepted, 1 failed, 2 usage, 3 review, 4 rejected.");
  auto as_json = std::make_shared<bool>(false);
  add_study_options(*command, options->study);
  command->add_option("-o,--output", options->output, "Folder for the results")->required()->type_name("FOLDER");
  command->add_option("--truth", options->truth, "truth.json of a phantom study, to print beside the result")
      ->type_name("FILE");
  add_start_option(*command, *options);
  command->add_flag_callback(
      "--no-search", [options] { options->registration.search.is_searched = false; },
      "Judge the pose of --start, or the planned one, and search none");
  add_result_options(*command, *options);
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  command->add_flag("--json", *as_json, "Print result.json instead of the report");
  add_registration_switches(*command, options->registration);
  command->callback(
      [options, as_json, &console, &exit_status] { exit_status = run_register(*options, *as_json, console); });
}

}  // namespace isoshift
