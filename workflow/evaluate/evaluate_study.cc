#include "workflow/evaluate/evaluate_study.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>

#include "base/error.h"
#include "base/json_file.h"
#include "base/version.h"
#include "geometry/rotation.h"
#include "geometry/target_error.h"
#include "registration/quality/findings.h"
#include "setup/couch_shift.h"
#include "workflow/evaluate/compared_bodies.h"
#include "workflow/register/same_setup.h"
#include "workflow/register/target_of.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

// The upper three rows.
Json rows_of(const Eigen::Isometry3d& transform) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) rows.push_back(transform.matrix()(row, column));
  return rows;
}

Json rows_of(const std::vector<BodyTruth>& truths) {
  Json rows = Json::array();
  for (const BodyTruth& truth : truths) {
    Json row = rows_of(truth.setup_error);
    for (const double component : truth.center_patient_mm) row.push_back(component);
    rows.push_back(std::move(row));
  }
  return rows;
}

// All that the runs depend on: an evaluation is continued only where it is the same.
Json configuration_of(const EvaluateOptions& options, const Study& study, const Renderer& renderer,
                      const Target& target) {
  const RegistrationRequest& request = options.registration;
  const StartProtocol& protocol = options.protocol;
  Json images = Json::array(), settings = Json::object();
  for (const RtImage& image : study.rt_images) images.push_back(image.sop_instance_uid);
  for (const auto& [name, value] : request.rendering.settings()) settings[name] = value;
  std::vector<XrayView> views;
  Json cameras = Json::array();
  for (const XrayImage& xray : study.xrays) {
    views.push_back(xray.view);
    const auto& matrix = xray.view.pixel_from_room;
    cameras.push_back({{"pixel_from_room", std::vector<double>(matrix.data(), matrix.data() + matrix.size())},
                       {"megavoltage", xray.view.beam == Beam::kMegavoltage}});
  }
  const AttenuationModel model = request.rendering.model();
  return {{"program", fmt::format("isoshift {} ({})", kVersion, kCommit)},
          {"ct_series", study.ct->series_instance_uid},
          {"images", images},
          {"truth", rows_of(options.truth)},
          {"body_truths", rows_of(options.body_truths)},
          {"planned_room_from_patient", rows_of(study.planned_room_from_patient)},
          {"cameras", cameras},  // columns of each matrix
          {"intensity", options.study.intensity},
          {"structure_set", study.structures ? study.structures->sop_instance_uid : ""},
          {"renderer", to_string(renderer.kind())},
          {"device", renderer.device()},
          {"renderer_settings", settings},
          {"attenuation", request.rendering.attenuation_name()},
          {"threshold_hu", request.rendering.threshold_hu},
          {"window_hu", {model.window_low_hu, model.window_high_hu}},
          {"preset", request.search.preset},
          {"similarity", request.search.similarity.value_or("")},
          {"optimizer", request.search.optimizer.value_or("")},
          {"pixel_fraction", request.search.pixel_fraction.value_or(0.0)},
          {"dof", request.search.dof},
          {"check_vertebrae", request.search.check_vertebrae},
          {"structures", request.region.structures},
          {"bodies", request.region.bodies},
          {"excluded", request.region.excluded},
          {"around_isocenter_mm", request.region.around_isocenter_mm.value_or(0.0)},
          {"margin_mm", request.region.margin_mm},
          {"rectangles", request.region.rectangles},
          {"target", target.name},
          {"seed", request.search.seed},
          {"seed_per_run", options.has_seed_per_run},
          {"pixel_mm", request.search.pixel_mm.value_or(0.0)},
          {"relative_tolerance", request.search.relative_tolerance.value_or(0.0)},
          {"searches", request.search.searches},
          {"series", to_string(protocol.series)},
          {"max_rotation_deg", deg_from_rad(protocol.max_rotation_rad)},
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

// The farthest corner of a box about the target's center, of the edge of the vertebral bodies that are targets.
double target_error_mm(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth, const Target& target) {
  constexpr double kHalfEdgeMm = 7.5;
  double farthest_mm = 0.0;
  for (int n = 0; n < 8; ++n) {
    const Eigen::Vector3d side((n & 1) != 0 ? 1.0 : -1.0, (n & 2) != 0 ? 1.0 : -1.0, (n & 4) != 0 ? 1.0 : -1.0);
    const Eigen::Vector3d corner = target.center_room_mm + kHalfEdgeMm * side;
    farthest_mm = std::max(farthest_mm, (found * corner - truth * corner).norm());
  }
  return farthest_mm;
}

void add_errors(const RegistrationResult& result, const Eigen::Isometry3d& truth, const Study& study,
                const Target& target, EvaluatedRun& run) {
  const std::vector<Eigen::Vector3d> targets_mm = standard_targets_mm();
  const Eigen::Isometry3d found =
      setup_error_from_poses(study.planned_room_from_patient, result.actual_room_from_patient);
  run.mtre_mm = mean_target_registration_error_mm(found, truth, targets_mm);
  run.mpd_mm = run.mrpd_mm = 0.0;
  run.target_mm = target_error_mm(found, truth, target);
  for (const XrayImage& xray : study.xrays) {
    const auto views = static_cast<double>(study.xrays.size());
    run.mpd_mm += mean_projection_distance_mm(found, truth, targets_mm, xray.view) / views;
    run.mrpd_mm += mean_reprojection_distance_mm(found, truth, targets_mm, xray.view) / views;
  }
  run.rotation_share = rotation_share(found, truth, targets_mm);
  const Eigen::Isometry3d error = found * truth.inverse();
  const Eigen::Vector3d turn_rad = rotation_vector(error.linear());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto n = static_cast<Eigen::Index>(axis);
    run.error[axis] = error.translation()[n];
    run.error[axis + 3] = deg_from_rad(turn_rad[n]);
  }
  if (!result.uncertainty) return;
  run.sigma.emplace();
  const Eigen::Vector3d sigma_mm = result.uncertainty->sigma_translation_mm();
  const Eigen::Vector3d sigma_rad = result.uncertainty->sigma_rotation_rad();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto n = static_cast<Eigen::Index>(axis);
    (*run.sigma)[axis] = sigma_mm[n];
    (*run.sigma)[axis + 3] = deg_from_rad(sigma_rad[n]);
  }
}

// A registration that ends with an error counts as one that found nothing.
EvaluatedRun evaluated(int number, const StartPose& start, const EvaluateOptions& options, const Study& study,
                       std::span<const FixedImage> images, const Target& target,
                       const TargetRegistration& registration) {
  constexpr double kNothing = std::numeric_limits<double>::infinity();
  EvaluatedRun run{.number = number,
                   .start_mtre_mm = start.mtre_mm,
                   .mtre_mm = kNothing,
                   .mpd_mm = kNothing,
                   .mrpd_mm = kNothing,
                   .target_mm = kNothing};
  try {
    const std::uint64_t seed =
        options.registration.search.seed + (options.has_seed_per_run ? static_cast<std::uint64_t>(number) : 0);
    const RegistrationResult result =
        registration.from(start.setup_error * study.planned_room_from_patient, images, {}, seed);
    add_errors(result, options.truth, study, target, run);
    run.bodies = compared_bodies(result.bodies, options.body_truths, options.truth, study.planned_room_from_patient);
    run.verdict = result.verdict();
    run.reasons = joined(result.reasons());
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
void run_missing(EvaluationFolder& folder, const Study& study, const Target& target,
                 const TargetRegistration& registration, const EvaluateOptions& options, int jobs, Observer& observer) {
  const std::vector<StartPose> starts = start_poses(options.truth, options.protocol);
  const std::vector<FixedImage> images = prepared(study.xrays);
  std::vector<int> missing;
  for (int number = 0; number < static_cast<int>(starts.size()); ++number)
    if (!folder.has(number)) missing.push_back(number);
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&] {
    for (std::size_t n = next++; n < missing.size(); n = next++) try {
        const int number = missing[n];
        const EvaluatedRun run = evaluated(number, starts[number], options, study, images, target, registration);
        const std::lock_guard lock(mutex);
        folder.append(run);
        observer.progress("Evaluating", folder.runs().size(), starts.size());
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
    threads.reserve(static_cast<std::size_t>(jobs));
    for (int job = 0; job < jobs; ++job) threads.emplace_back([&] { tbb::task_arena(1).execute(work); });
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace

EvaluationFolder evaluate_study(const EvaluateOptions& options, Notes& notes, Observer& observer) {
  return evaluate_loaded(load(options.study, notes, observer), options, observer);
}

void check_jobs(int jobs, RendererKind kind) {
  if (uses_gl(kind) && jobs > 1)
    throw UsageError(fmt::format("--jobs {}: {} renders for one registration at a time", jobs, to_string(kind)));
}

EvaluationFolder evaluate_loaded(const Study& study, EvaluateOptions options, Observer& observer) {
  const RendererKind kind = options.registration.rendering.kind();
  check_jobs(options.jobs, kind);
  if (!options.truth_file.empty())
    require_same_setup(read_json_file(options.truth_file).json, options.truth_file.string(), study);
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int jobs = uses_gl(kind) ? 1 : options.jobs > 0 ? options.jobs : cores;
  const TargetChoice choice = target_of(study, {.by_person = options.target});
  if (!options.target.empty())
    options.truth = truth_at(study.planned_room_from_patient.inverse() * choice.target.center_room_mm, options.truth,
                             study.isocenter_patient_mm, options.body_truths);
  BodyStore bodies;
  const Surrogate surrogate = surrogate_of(study, choice.target, "", bodies);
  RendererStore renderers;
  const RegistrationSetup setup(options.registration, study, beams_of(study), renderers);
  const TargetRegistration registration(target_problem(study, options.registration, setup, choice, surrogate),
                                        setup.renderers(), setup.rendered_ct(), bodies);
  const Json configuration = configuration_of(options, study, setup.renderers().finest(), choice.target);
  if (!options.of_study.empty() && study_in(configuration) != options.of_study)
    throw Error(
        fmt::format("{}: its other evaluations are of another study (CT, X-rays or truth); a table is of one.\n       "
                    "Choose another folder with -o",
                    options.output.parent_path().string()));
  EvaluationFolder folder(options.output, configuration);
  run_missing(folder, study, choice.target, registration, options, jobs, observer);
  folder.write_summary();
  return folder;
}

}  // namespace isoshift
