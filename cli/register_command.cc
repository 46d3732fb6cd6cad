#include "cli/register_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <memory>

#include "cli/commands.h"
#include "cli/setup_report_of.h"
#include "cli/truth.h"
#include "geometry/couch_shift.h"
#include "geometry/error.h"
#include "io/output_folder.h"
#include "io/report/formats.h"
#include "io/report/result_folder.h"
#include "io/spatial_registration.h"

namespace isoshift {
namespace {

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

// Accepted results are written; those for review, and those with a direction that nobody measured, only on request.
bool may_write_registration(const RegisterOptions& options, const RegistrationResult& result) {
  if (!result.unobservable_room.empty() && !options.accept_unobservable) return false;
  return result.verdict == Verdict::kAccepted || (result.verdict == Verdict::kReview && options.write_reg_for_review);
}

// The pose to be written: without setup error along directions that nobody measured, each an override.
Eigen::Isometry3d written_pose(const Study& study, const RegistrationResult& result, Notes& notes) {
  Eigen::Isometry3d error = setup_error_from_poses(study.planned_room_from_patient, result.actual_room_from_patient);
  for (const Eigen::Vector3d& direction : result.unobservable_room) {
    error.translation() -= direction.dot(error.translation()) * direction;
    notes.overrides.push_back(
        fmt::format("spatial registration: no setup error along ({:.3f}), which was not measured, by "
                    "--accept-unobservable",
                    fmt::join(direction, ", ")));
  }
  return error * study.planned_room_from_patient;
}

SpatialRegistrationOptions registration_options(RegistrationSource source, Verdict verdict) {
  if (verdict == Verdict::kAccepted) return {.source = source};
  return {.content_label = "SETUP_REVIEW", .content_description = "NOT ACCEPTED: REVIEW", .source = source};
}

}  // namespace

int exit_status_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAccepted: return kExitAccepted;
    case Verdict::kReview: return kExitReview;
    case Verdict::kRejected: return kExitRejected;
  }
  return kExitFailed;
}

SetupReport register_study(const RegisterOptions& options, SharedWork& shared, Console& console) {
  const Stopwatch total;
  OutputFolder output(options.output, options.overwrite);
  const std::optional<SiteFile> site_file = named_site(options.site);
  std::optional<SetupReport::Site> site = chosen_site(site_file, options.anatomy);

  Notes notes;
  StudyOptions named = options.study;
  if (site_file && site_file->sessions) named.max_span_s = site_file->sessions->max_span_s;
  const Study study = load(named, notes, console, shared.cts);
  const RegistrationSetup setup(options.flags, study, beams_of(study), shared.renderers);
  const double seconds_load = total.seconds();
  RegistrationResult result;
  {
    ProgressBar bar(console, "Registering");
    result = register_views(setup.renderers(), study.xrays, study.planned_room_from_patient, setup.options(),
                            [&](double share) { bar.update(share); });
  }
  for (const std::string& doubt : study.doubts) result.demote(Verdict::kReview, doubt);

  SetupReport report = setup_report_of(study, options.flags, setup, result);
  report.site = std::move(site);
  if (may_write_registration(options, result))
    report.spatial_registration_uid = write_spatial_registration(study, written_pose(study, result, notes),
                                                                 registration_options(options.source, result.verdict),
                                                                 output.path() / kRegistrationFile, notes);
  report.overrides = notes.overrides;
  report.left_aside = notes.left_aside;
  report.warnings = notes.warnings;
  report.seconds_load = seconds_load;
  report.seconds_total = total.seconds();
  write_result(report, output.path());
  output.commit();
  return report;
}

namespace {

int run_register(RegisterOptions options, const std::filesystem::path& truth_file, bool as_json, Console& console) {
  options.flags.settle();
  std::optional<Eigen::Isometry3d> truth;
  if (!truth_file.empty()) truth = read_setup_error(truth_file);
  SharedWork none;
  const SetupReport report = register_study(options, none, console);
  print_warnings(report.warnings, console);
  console.out << (as_json ? json_report(report) : text_report(report_page(report)));
  if (!as_json) {
    if (truth) console.out << "\n" << compared_with_truth(report.setup_error, *truth);
    console.out << fmt::format("\nWritten to {}\n",
                               std::filesystem::absolute(options.output).lexically_normal().string());
  }
  return exit_status_of(report.verdict);
}

}  // namespace

void add_result_options(CLI::App& command, RegisterOptions& options) {
  command
      .add_option("--site", options.site,
                  "Site file: action levels, the couch's degrees of freedom and scale (docs/site-file.md)")
      ->type_name("FILE");
  command.add_option("--anatomy", options.anatomy, "Whose action level of the site file applies")->type_name("NAME");
  command.add_flag("--write-reg-for-review", options.write_reg_for_review,
                   "Write the registration object for a result that needs review, too, marked as not accepted");
  command.add_flag("--accept-unobservable", options.accept_unobservable,
                   "Write it with no setup error along directions that the views cannot measure, too");
  command
      .add_option_function<std::string>(
          "--source-for",
          [&options](const std::string& name) {
            options.source = name == "treatment" ? RegistrationSource::kTreatment : RegistrationSource::kIecFixed;
          },
          "Axes that the registration object takes to the CT: the patient's as planned, or the room's")
      ->check(CLI::IsMember({"treatment", "iec-fixed"}))
      ->default_str("treatment");
}

void add_register_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<RegisterOptions>();
  CLI::App* command = app.add_subcommand("register", "Find the setup shift of an exported study");
  command->footer(
      "\nExample:\n  isoshift register exported/ -o result\n"
      "  isoshift register images/ --ct planning_ct/ --plan RTPLAN.dcm -o result --couch-angle 0\n\n"
      "Writes the report (report.pdf, .html, .txt, .csv, and .dcm: Encapsulated PDF), result.json, pictures per view\n"
      "and, for an accepted result, spatial_registration.dcm.\n"
      "Exit status: 0 accepted, 1 failed, 2 usage, 3 review, 4 rejected.");
  auto truth = std::make_shared<std::filesystem::path>();
  auto as_json = std::make_shared<bool>(false);
  add_study_options(*command, options->study);
  command->add_option("-o,--output", options->output, "Folder for the results")->required()->type_name("FOLDER");
  command->add_option("--truth", *truth, "truth.json of a phantom study: print the result beside it")
      ->type_name("FILE");
  add_result_options(*command, *options);
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  command->add_flag("--json", *as_json, "Print result.json instead of the report");
  add_registration_flags(*command, options->flags);
  command->callback([options, truth, as_json, &console, &exit_status] {
    exit_status = run_register(*options, *truth, *as_json, console);
  });
}

}  // namespace isoshift
