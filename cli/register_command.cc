#include "cli/register_command.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <memory>

#include "cli/commands.h"
#include "cli/truth.h"
#include "geometry/error.h"
#include "geometry/rotation.h"
#include "io/output_folder.h"
#include "io/report/pictures.h"
#include "io/report/setup_report.h"
#include "io/spatial_registration.h"
#include "registration/preprocess/preprocess.h"

namespace isoshift {
namespace {

constexpr const char* kRegistrationFile = "spatial_registration.dcm";

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

int exit_status_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAccepted: return kExitAccepted;
    case Verdict::kReview: return kExitReview;
    case Verdict::kRejected: return kExitRejected;
  }
  return kExitFailed;
}

std::vector<SetupReport::Part> parts_in_report(const ViewConsistency& consistency) {
  std::vector<SetupReport::Part> parts;
  for (const Tile& tile : consistency.tiles)
    parts.push_back({.center_px = tile.center_px,
                     .width_px = tile.width_px,
                     .displacement_mm = tile.displacement_mm,
                     .correlation = tile.correlation,
                     .best_correlation = tile.best_correlation,
                     .has_signal = tile.has_signal,
                     .disagrees = tile.disagrees});
  return parts;
}

SetupReport::Stage stage_in_report(const Stage& stage, const StageReport& done) {
  SetupReport::Stage shown{.name = done.name,
                           .similarity = done.similarity,
                           .optimizer = std::string(to_string(stage.optimizer)),
                           .parameters = {{"pixel_mm", stage.pixel_mm},
                                          {"voxel_mm", stage.voxel_mm},
                                          {"pixel_fraction", stage.pixel_fraction},
                                          {"min_pixels", stage.min_pixels},
                                          {"candidates", stage.candidates},
                                          {"starts", stage.starts},
                                          {"keep", stage.keep},
                                          {"reach_mm", stage.reach_mm},
                                          {"reach_deg", deg_from_rad(stage.reach_rad)},
                                          {"initial_step_mm", stage.initial_step_mm},
                                          {"initial_step_deg", deg_from_rad(stage.initial_step_rad)},
                                          {"relative_tolerance", stage.relative_tolerance},
                                          {"max_evaluations", stage.max_evaluations}},
                           .evaluations = done.evaluations,
                           .seconds = done.seconds,
                           .value = done.value,
                           .termination = done.termination,
                           .spread_mm = done.spread_mm};
  if (done.spread_rad) shown.spread_deg = deg_from_rad(*done.spread_rad);
  return shown;
}

SetupReport make_report(const RegisterOptions& options, const Study& study, const Renderer& renderer,
                        const RegistrationOptions& registration, const RegistrationResult& result) {
  SetupReport report;
  report.verdict = result.verdict;
  report.reasons = result.reasons;
  report.patient_id = study.ct.identity.patient_id;
  report.patient_name = study.ct.identity.patient_name;
  report.plan_label = study.plan ? study.plan->label : "";
  report.patient_position = to_string(study.patient_position);
  report.isocenter_patient_mm = study.isocenter_patient_mm;
  report.table = study.table;
  report.setup_error = setup_error_from_poses(study.planned_room_from_patient, result.actual_room_from_patient);
  report.unobservable_room = result.unobservable_room;
  report.translation_only = registration.dof == Dof::kTranslation;
  for (std::size_t n = 0; n < study.rt_images.size(); ++n) {
    const std::optional<LeftOutView>& left_out = result.views[n].left_out;
    report.views.push_back({.label = study.rt_images[n].label,
                            .sop_instance_uid = study.rt_images[n].sop_instance_uid,
                            .frame = study.rt_images[n].frame + 1,
                            .gantry_deg = study.rt_images[n].gantry_angle_deg,
                            .similarity_start = result.views[n].similarity_start,
                            .similarity_final = result.views[n].similarity_final,
                            .left_out_mm = left_out ? std::optional(left_out->distance_mm) : std::nullopt,
                            .left_out_deg = left_out ? std::optional(deg_from_rad(left_out->angle_rad)) : std::nullopt,
                            .parts = parts_in_report(result.views[n].consistency)});
  }
  for (std::size_t n = 0; n < result.stages.size(); ++n)
    report.stages.push_back(stage_in_report(registration.stages[n], result.stages[n]));
  if (result.uncertainty)
    report.sigma = {.translation_mm = result.uncertainty->translation_mm,
                    .rotation_deg = result.uncertainty->rotation_rad.unaryExpr(&deg_from_rad)};
  for (const Alternative& alternative : result.alternatives)
    report.alternatives.push_back(
        {.description = alternative.description, .similarity = alternative.similarity, .as_is = alternative.as_is});
  report.preset = registration.preset;
  report.region = options.flags.region.in_words();
  report.seed = registration.seed;
  report.attenuation = options.flags.rendering.attenuation_name();
  const AttenuationModel model = options.flags.rendering.model();
  report.threshold_hu = model.threshold_hu;
  if (model.kind == AttenuationModel::Kind::kWindowed) report.window_hu = {model.window_low_hu, model.window_high_hu};
  report.renderer = to_string(renderer.kind());
  report.device = renderer.device();
  report.renderer_settings = options.flags.rendering.settings();
  report.seconds_register = result.seconds;
  report.seconds_rendering = result.seconds_rendering;
  report.seconds_similarity = result.seconds_similarity;
  if (study.machine) report.machine = {study.machine->name, study.machine->sha256};
  report.ct_series_uid = study.ct.series_instance_uid;
  report.plan_uid = study.plan ? study.plan->sop_instance_uid : "";
  return report;
}

// Accepted results are written; those for review only on request, and never along a direction nobody measured.
bool may_write_registration(const RegisterOptions& options, const RegistrationResult& result) {
  if (!result.unobservable_room.empty()) return false;
  return result.verdict == Verdict::kAccepted || (result.verdict == Verdict::kReview && options.write_reg_for_review);
}

SpatialRegistrationOptions registration_options(RegistrationSource source, Verdict verdict) {
  if (verdict == Verdict::kAccepted) return {.source = source};
  return {.content_label = "SETUP_REVIEW", .content_description = "NOT ACCEPTED: REVIEW", .source = source};
}

std::vector<ViewComparison::Disagreement> disagreements_of(const ViewReport& view, const XrayView& camera) {
  std::vector<ViewComparison::Disagreement> list;
  for (const Tile& tile : view.consistency.tiles)
    if (tile.disagrees)
      list.push_back({.center_px = tile.center_px,
                      .width_px = tile.width_px,
                      .displacement_px = tile.displacement_mm * pixels_per_mm(camera)});
  return list;
}

// One picture per view, of what is rendered for the search.
void write_pictures(const Study& study, Renderer& renderer, const RegistrationResult& result,
                    const std::filesystem::path& folder) {
  const std::array poses = {study.planned_room_from_patient, result.actual_room_from_patient};
  for (std::size_t n = 0; n < study.xrays.size(); ++n) {
    const XrayImage& xray = study.xrays[n];
    const RenderResult drrs = renderer.render(std::span(&xray.view, 1), poses, PixelSet::all());
    const FixedImage compared = prepare(xray);
    const Image<float> planned = image_of(xray.view, drrs.line_integrals(0, 0));
    const Image<float> found = image_of(xray.view, drrs.line_integrals(1, 0));
    write_comparison_png(folder / fmt::format("view{}.png", n + 1),
                         {.label = xray.label,
                          .xray = compared.line_integral,
                          .field = compared.field,
                          .drr_planned = planned,
                          .drr_found = found,
                          .isocenter_px = xray.view.project(Eigen::Vector3d::Zero()).value(),
                          .disagreements = disagreements_of(result.views[n], xray.view)});
  }
}

}  // namespace

int run_register(const RegisterOptions& given, Console& console) {
  RegisterOptions options = given;
  options.flags.settle();
  const Stopwatch total;
  OutputFolder output(options.output, options.overwrite);
  std::optional<Eigen::Isometry3d> truth;
  if (!options.truth.empty()) truth = read_setup_error(options.truth);

  Notes notes;
  const Study study = load(options.study, notes, console);
  const RegistrationSetup setup(options.flags, study);
  Renderer& renderer = setup.renderers().finest();
  const double seconds_load = total.seconds();
  RegistrationResult result;
  {
    ProgressBar bar(console, "Registering");
    result = register_views(setup.renderers(), study.xrays, study.planned_room_from_patient, setup.options(),
                            [&](double share) { bar.update(share); });
  }

  SetupReport report = make_report(options, study, renderer, setup.options(), result);
  if (may_write_registration(options, result))
    report.spatial_registration_uid = write_spatial_registration(study, result.actual_room_from_patient,
                                                                 registration_options(options.source, result.verdict),
                                                                 output.path() / kRegistrationFile, notes);
  write_pictures(study, renderer, result, output.path());
  report.overrides = notes.overrides;
  report.left_aside = notes.left_aside;
  report.warnings = notes.warnings;
  report.seconds_load = seconds_load;
  report.seconds_total = total.seconds();
  const std::string json = json_report(report);
  const std::string text = text_report(report);
  write_text(output.path() / "result.json", json);
  write_text(output.path() / "report.txt", text);
  output.commit();

  for (const std::string& warning : report.warnings) console.err << "warning: " << warning << "\n";
  console.out << (options.json ? json : text);
  if (!options.json) {
    if (truth) console.out << "\n" << compared_with_truth(report.setup_error, *truth);
    console.out << fmt::format("\nWritten to {}\n", output.destination().string());
  }
  return exit_status_of(result.verdict);
}

void add_register_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<RegisterOptions>();
  CLI::App* command = app.add_subcommand("register", "Find the setup shift of an exported study");
  command->footer(
      "\nExample:\n  isoshift register exported/ -o result\n"
      "  isoshift register images/ --ct planning_ct/ --plan RTPLAN.dcm -o result --couch-angle 0\n\n"
      "Writes report.txt, result.json, a picture per view and, for an accepted result, spatial_registration.dcm.\n"
      "Exit status: 0 accepted, 1 failed, 2 usage, 3 review, 4 rejected.");
  add_study_options(*command, options->study);
  command->add_option("-o,--output", options->output, "Folder for the results")->required()->type_name("FOLDER");
  command->add_option("--truth", options->truth, "truth.json of a phantom study: print the result beside it")
      ->type_name("FILE");
  command->add_flag("--write-reg-for-review", options->write_reg_for_review,
                    "Write the registration object for a result that needs review, too, marked as not accepted");
  command
      ->add_option_function<std::string>(
          "--source-for",
          [options](const std::string& name) {
            options->source = name == "treatment" ? RegistrationSource::kTreatment : RegistrationSource::kIecFixed;
          },
          "Axes that the registration object takes to the CT: the patient's as planned, or the room's")
      ->check(CLI::IsMember({"treatment", "iec-fixed"}))
      ->default_str("treatment");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  command->add_flag("--json", options->json, "Print result.json instead of the report");
  add_registration_flags(*command, options->flags);
  command->callback([options, &console, &exit_status] { exit_status = run_register(*options, console); });
}

}  // namespace isoshift
