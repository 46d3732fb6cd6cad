// isoshift evaluate: many registrations from published starts, their errors against a known truth.

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <exception>
#include <limits>
#include <memory>
#include <mutex>
#include <thread>

#include "cli/commands.h"
#include "cli/evaluation_files.h"
#include "cli/registration_setup.h"
#include "cli/study_options.h"
#include "cli/truth.h"
#include "geometry/couch_shift.h"
#include "geometry/error.h"
#include "geometry/rotation.h"
#include "geometry/target_error.h"
#include "io/version.h"
#include "registration/quality/judge.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct EvaluateOptions {
  StudyOptions study;
  RegistrationFlags flags;
  std::string series = "bins";
  std::optional<int> starts;
  std::optional<double> distance_mm;
  std::uint64_t start_seed = 1;
  int jobs = 0;
  std::filesystem::path truth, output;
  std::vector<std::filesystem::path> table;
};

StartProtocol protocol_of(const EvaluateOptions& options) {
  StartProtocol protocol = options.series == "paper" ? StartProtocol::paper() : StartProtocol{};
  protocol.count = options.starts.value_or(protocol.count);
  protocol.distance_mm = options.distance_mm.value_or(protocol.distance_mm);
  protocol.seed = options.start_seed;
  protocol.check();
  return protocol;
}

// The upper three rows.
Json rows_of(const Eigen::Isometry3d& transform) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) rows.push_back(transform.matrix()(row, column));
  return rows;
}

// All that the runs depend on: an evaluation is continued only where it is the same.
Json configuration_of(const RegistrationFlags& flags, const std::string& intensity, const Study& study,
                      const Renderer& renderer, const Eigen::Isometry3d& truth, const StartProtocol& protocol) {
  Json images = Json::array(), settings = Json::object();
  for (const RtImage& image : study.rt_images) images.push_back(image.sop_instance_uid);
  for (const auto& [name, value] : flags.rendering.settings()) settings[name] = value;
  std::vector<XrayView> views;
  Json cameras = Json::array();
  for (const XrayImage& xray : study.xrays) {
    views.push_back(xray.view);
    const auto& matrix = xray.view.pixel_from_room;
    cameras.push_back({{"pixel_from_room", std::vector<double>(matrix.data(), matrix.data() + matrix.size())},
                       {"megavoltage", xray.view.beam == Beam::kMegavoltage}});
  }
  const AttenuationModel model = flags.rendering.model();
  return {{"program", fmt::format("isoshift {} ({})", kVersion, kCommit)},
          {"ct_series", study.ct->series_instance_uid},
          {"images", images},
          {"truth", rows_of(truth)},
          {"planned_room_from_patient", rows_of(study.planned_room_from_patient)},
          {"cameras", cameras},  // columns of each matrix
          {"intensity", intensity},
          {"structure_set", study.structures ? study.structures->sop_instance_uid : ""},
          {"renderer", to_string(renderer.kind())},
          {"device", renderer.device()},
          {"renderer_settings", settings},
          {"attenuation", flags.rendering.attenuation_name()},
          {"threshold_hu", flags.rendering.threshold_hu},
          {"window_hu", {model.window_low_hu, model.window_high_hu}},
          {"preset", flags.search.preset},
          {"similarity", flags.search.similarity.value_or("")},
          {"optimizer", flags.search.optimizer.value_or("")},
          {"pixel_fraction", flags.search.pixel_fraction.value_or(0.0)},
          {"dof", flags.search.dof},
          {"check_vertebrae", flags.search.check_vertebrae},
          {"structures", flags.region.structures},
          {"excluded", flags.region.excluded},
          {"around_isocenter_mm", flags.region.around_isocenter_mm.value_or(0.0)},
          {"margin_mm", flags.region.margin_mm},
          {"rectangles", flags.region.rectangles},
          {"seed", flags.search.seed},
          {"series", protocol.series == StartProtocol::Series::kPaper ? "paper" : "bins"},
          {"start_seed", protocol.seed},
          {"starts", protocol.count},
          {"distance_mm", protocol.distance_mm},
          {"success_by", unobservable_directions(views).empty() ? "mTRE" : "mRPD"}};
}

std::string joined(const std::vector<std::string>& reasons) {
  std::string text;
  for (const std::string& reason : reasons) text += (text.empty() ? "" : "; ") + reason;
  return text;
}

void add_errors(const RegistrationResult& result, const Eigen::Isometry3d& truth, const Study& study,
                EvaluatedRun& run) {
  const std::vector<Eigen::Vector3d> targets_mm = standard_targets_mm();
  const Eigen::Isometry3d found =
      setup_error_from_poses(study.planned_room_from_patient, result.actual_room_from_patient);
  run.mtre_mm = mean_target_registration_error_mm(found, truth, targets_mm);
  run.mpd_mm = run.mrpd_mm = 0.0;
  for (const XrayImage& xray : study.xrays) {
    const auto views = static_cast<double>(study.xrays.size());
    run.mpd_mm += mean_projection_distance_mm(found, truth, targets_mm, xray.view) / views;
    run.mrpd_mm += mean_reprojection_distance_mm(found, truth, targets_mm, xray.view) / views;
  }
  run.rotation_share = rotation_share(found, truth, targets_mm);
  const Eigen::Isometry3d error = found * truth.inverse();
  const Eigen::AngleAxisd turn(error.linear());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto n = static_cast<Eigen::Index>(axis);
    run.error[axis] = error.translation()[n];
    run.error[axis + 3] = deg_from_rad(turn.angle()) * turn.axis()[n];
  }
  if (!result.uncertainty) return;
  run.sigma.emplace();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto n = static_cast<Eigen::Index>(axis);
    (*run.sigma)[axis] = result.uncertainty->translation_mm[n];
    (*run.sigma)[axis + 3] = deg_from_rad(result.uncertainty->rotation_rad[n]);
  }
}

// A registration that ends with an error counts as one that found nothing.
EvaluatedRun evaluated(int number, const StartPose& start, const Eigen::Isometry3d& truth, const Study& study,
                       const RegistrationSetup& setup) {
  constexpr double kNothing = std::numeric_limits<double>::infinity();
  EvaluatedRun run{
      .number = number, .start_mtre_mm = start.mtre_mm, .mtre_mm = kNothing, .mpd_mm = kNothing, .mrpd_mm = kNothing};
  try {
    const RegistrationResult result = register_views(
        setup.renderers(), study.xrays, start.setup_error * study.planned_room_from_patient, setup.options());
    add_errors(result, truth, study, run);
    run.verdict = result.verdict;
    run.reasons = joined(result.reasons);
    run.evaluations = result.evaluations();
    run.seconds = result.seconds;
    run.seconds_rendering = result.seconds_rendering;
    run.seconds_similarity = result.seconds_similarity;
  } catch (const Error& error) {
    run.reasons = error.what();
  }
  return run;
}

// Runs what is missing, several at a time, each on one thread; alone, one uses all. What it finds does not depend on
// that.
void run_missing(EvaluationFolder& folder, const Study& study, const RegistrationSetup& setup,
                 const Eigen::Isometry3d& truth, const std::vector<StartPose>& starts, int jobs, ProgressBar& bar) {
  std::vector<int> missing;
  for (int number = 0; number < static_cast<int>(starts.size()); ++number)
    if (!folder.has(number)) missing.push_back(number);
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&] {
    for (std::size_t n = next++; n < missing.size(); n = next++) try {
        const int number = missing[n];
        const EvaluatedRun run = evaluated(number, starts[number], truth, study, setup);
        const std::lock_guard lock(mutex);
        folder.append(run);
        bar.update(folder.runs().size(), starts.size());
      } catch (...) {
        const std::lock_guard lock(mutex);
        failure = std::current_exception();
        next = missing.size();
      }
  };
  if (jobs == 1) {
    work();
  } else {
    std::vector<std::jthread> threads;
    for (int job = 0; job < jobs; ++job) threads.emplace_back([&] { tbb::task_arena(1).execute(work); });
  }
  if (failure) std::rethrow_exception(failure);
}

int print_table(const EvaluateOptions& options, Console& console) {
  std::vector<std::pair<std::string, EvaluationSummary>> rows;
  for (const std::filesystem::path& path : options.table) {
    const EvaluationFolder folder(path);
    rows.emplace_back(path.filename().empty() ? path.parent_path().filename().string() : path.filename().string(),
                      summarized(folder.runs(), folder.judged_by_mrpd()));
  }
  console.out << evaluation_table(rows);
  return kExitAccepted;
}

int run_evaluate(EvaluateOptions options, Console& console) {
  if (!options.table.empty()) return print_table(options, console);
  if (options.truth.empty() || options.output.empty())
    throw UsageError("an evaluation needs --truth and -o (or --table to look at earlier ones)");
  const StartProtocol protocol = protocol_of(options);
  options.flags.settle();
  const RendererKind kind = options.flags.rendering.kind();
  if (uses_gl(kind) && options.jobs > 1)
    throw UsageError(
        fmt::format("--jobs {}: {} renders for one registration at a time", options.jobs, to_string(kind)));
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int jobs = uses_gl(kind) ? 1 : options.jobs > 0 ? options.jobs : cores;
  const Eigen::Isometry3d truth = read_setup_error(options.truth);

  Notes notes;
  const Study study = load(options.study, notes, console);
  RendererStore renderers;
  const RegistrationSetup setup(options.flags, study, beams_of(study), renderers);
  EvaluationFolder folder(options.output, configuration_of(options.flags, options.study.intensity, study,
                                                           setup.renderers().finest(), truth, protocol));
  {
    ProgressBar bar(console, "Evaluating");
    run_missing(folder, study, setup, truth, start_poses(truth, protocol), jobs, bar);
  }
  folder.write_summary();
  print_warnings(notes.warnings, console);
  console.out << evaluation_table(
      {{options.output.filename().string(), summarized(folder.runs(), folder.judged_by_mrpd())}});
  return kExitAccepted;
}

}  // namespace

void add_evaluate_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<EvaluateOptions>();
  CLI::App* command = app.add_subcommand("evaluate", "Measure how good registration is, from many starts");
  command->footer(
      "\nExample:\n  isoshift evaluate exported/ --truth exported/truth.json -o evaluation\n"
      "  isoshift evaluate --table evaluation other_evaluation\n\n"
      "Writes runs.csv, summary.json, success.svg and errors.svg. Started again on the same folder, it goes on where "
      "it "
      "was\nstopped. The protocol is that of van de Kraats et al. (2005): docs/evaluation.md.");
  add_study_options(*command, options->study);
  command->add_option("--truth", options->truth, "truth.json of the study: the true setup error")->type_name("FILE");
  command->add_option("-o,--output", options->output, "Folder for the results")->type_name("FOLDER");
  command
      ->add_option("--series", options->series,
                   "bins: 200 starts spread over 0 to 20 mm of mTRE; paper: 150 starts 25 mm away")
      ->check(CLI::IsMember({"bins", "paper"}))
      ->capture_default_str();
  command->add_option("--starts", options->starts, "How many starts")->type_name("N");
  command->add_option("--distance", options->distance_mm, "bins: the largest mTRE at the start; paper: the translation")
      ->type_name("MM");
  command->add_option("--start-seed", options->start_seed, "Draws the starts")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command
      ->add_option("--jobs", options->jobs,
                   "Registrations at a time, each on one thread; 1: one on all cores, for its time (default: cores)")
      ->check(CLI::PositiveNumber);
  command->add_option("--table", options->table, "Print a table of evaluations made earlier")->type_name("FOLDER...");
  add_registration_flags(*command, options->flags);
  command->callback([options, &console, &exit_status] { exit_status = run_evaluate(*options, console); });
}

}  // namespace isoshift
