#include "registration/register_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <numeric>

#include "geometry/error.h"
#include "registration/objective.h"
#include "registration/optimizer.h"
#include "registration/preprocess/preprocess.h"
#include "registration/quality.h"

namespace isoshift {
namespace {

// Rotations are searched in mm on a sphere of this radius, so that all parameters move the anatomy alike.
constexpr double kLeverMm = 100.0;

double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

Eigen::Isometry3d setup_error_from_parameters(std::span<const double> parameters) {
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  if (parameters.size() == 6) {
    const Eigen::Vector3d rotation = Eigen::Vector3d(parameters.data() + 3) / kLeverMm;
    if (const double angle_rad = rotation.norm(); angle_rad > 0.0)
      setup_error.linear() = Eigen::AngleAxisd(angle_rad, rotation / angle_rad).toRotationMatrix();
  }
  setup_error.translation() = Eigen::Vector3d(parameters.data());
  return setup_error;
}

// The largest reduction that keeps pixels at the isocenter within the stage's size, and enough of them in a small
// field.
int reduction(const FixedImage& image, double pixel_mm) {
  constexpr double kMinFieldPixels = 900.0;
  const auto field_pixels = static_cast<double>(std::ranges::count_if(image.field.pixels, std::identity()));
  return std::max(
      1, static_cast<int>(std::min(pixel_mm * pixels_per_mm(image.view), std::sqrt(field_pixels / kMinFieldPixels))));
}

std::vector<FixedImage> reduced_to(std::span<const FixedImage> images, double pixel_mm) {
  std::vector<FixedImage> level;
  for (const FixedImage& image : images) level.push_back(reduced(image, reduction(image, pixel_mm)));
  return level;
}

OptimizerOptions optimizer_options(const Stage& stage, const RegistrationOptions& options,
                                   const std::vector<double>& start) {
  OptimizerOptions search;
  search.start = start;
  search.relative_tolerance = stage.relative_tolerance;
  search.max_evaluations = stage.max_evaluations;
  for (std::size_t n = 0; n < start.size(); ++n) {
    const double bound = n < 3 ? options.bound_mm : options.bound_rad * kLeverMm;
    search.lower.push_back(-bound);
    search.upper.push_back(bound);
    search.initial_step.push_back(n < 3 ? stage.initial_step_mm : stage.initial_step_rad * kLeverMm);
  }
  return search;
}

// Before anything is searched: the CT must appear in every view as planned.
void require_visible(Renderer& renderer, std::span<const XrayImage> xrays, std::span<const FixedImage> images,
                     const Eigen::Isometry3d& planned) {
  for (std::size_t n = 0; n < images.size(); ++n) {
    const XrayView view = images[n].view.downscaled(reduction(images[n], 5.0));
    const RenderResult drr = renderer.render(std::span(&view, 1), std::span(&planned, 1), PixelSet::all());
    require_not_empty(drr.line_integrals(0, 0), xrays[n].label);
  }
}

void report_views(Objective& objective, const Eigen::Isometry3d& planned, RegistrationResult& result) {
  const std::array poses = {planned, result.actual_room_from_patient};
  const auto similarity = objective.per_view(poses);
  for (std::size_t view = 0; view < similarity[0].size(); ++view)
    result.views.push_back({.similarity_start = similarity[0][view], .similarity_final = similarity[1][view]});
}

}  // namespace

std::vector<Stage> RegistrationOptions::default_stages() {
  return {
      {.name = "coarse", .pixel_mm = 5.0, .initial_step_mm = 8.0, .initial_step_rad = 0.06, .relative_tolerance = 0.02},
      {.name = "medium",
       .pixel_mm = 2.5,
       .pixel_fraction = 0.5,
       .initial_step_mm = 1.5,
       .initial_step_rad = 0.015,
       .relative_tolerance = 0.02},
      {.name = "fine",
       .similarity = SimilarityKind::kGradientCorrelation,
       .pixel_mm = 1.2,
       .initial_step_mm = 0.6,
       .initial_step_rad = 0.006,
       .relative_tolerance = 0.01},
  };
}

void RegistrationOptions::check() const {
  if (!(bound_mm > 0.0)) throw UsageError(fmt::format("bound_mm is {}, expected positive", bound_mm));
  if (!(bound_rad > 0.0)) throw UsageError(fmt::format("bound_rad is {}, expected positive", bound_rad));
  if (stages.empty()) throw UsageError("stages is empty, expected at least one");
}

int RegistrationResult::evaluations() const {
  return std::accumulate(stages.begin(), stages.end(), 0,
                         [](int sum, const StageReport& stage) { return sum + stage.evaluations; });
}

RegistrationResult register_views(Renderer& renderer, std::span<const XrayImage> xrays,
                                  const Eigen::Isometry3d& planned_room_from_patient,
                                  const RegistrationOptions& options, const SearchProgress& progress) {
  options.check();
  const auto begin = std::chrono::steady_clock::now();
  std::vector<FixedImage> images;
  for (const XrayImage& xray : xrays) images.push_back(prepare(xray));
  require_visible(renderer, xrays, images, planned_room_from_patient);

  RegistrationResult result;
  std::vector<double> parameters(options.dof == Dof::kRigid ? 6 : 3, 0.0);
  for (std::size_t n = 0; n < options.stages.size(); ++n) {
    const Stage& stage = options.stages[n];
    const auto stage_begin = std::chrono::steady_clock::now();
    Objective objective(renderer, reduced_to(images, stage.pixel_mm),
                        {.similarity = stage.similarity, .pixel_fraction = stage.pixel_fraction, .seed = options.seed});
    const OptimizerResult found = maximize(
        [&](std::span<const double> x) {
          const std::array pose = {setup_error_from_parameters(x) * planned_room_from_patient};
          return objective.values(pose).front();
        },
        optimizer_options(stage, options, parameters));
    parameters = found.best;
    result.seconds_rendering += objective.seconds().rendering;
    result.seconds_similarity += objective.seconds().similarity;
    result.stages.push_back({.name = stage.name,
                             .similarity = std::string(to_string(stage.similarity)),
                             .evaluations = found.evaluations,
                             .seconds = seconds_since(stage_begin),
                             .termination = found.termination,
                             .reached_limit = found.evaluations >= stage.max_evaluations});
    if (progress) progress(static_cast<double>(n + 1) / static_cast<double>(options.stages.size()));
  }
  result.actual_room_from_patient = setup_error_from_parameters(parameters) * planned_room_from_patient;
  Objective ncc(renderer, reduced_to(images, options.stages.back().pixel_mm), {.similarity = SimilarityKind::kNcc});
  report_views(ncc, planned_room_from_patient, result);

  std::vector<XrayView> views;
  for (const XrayImage& xray : xrays) views.push_back(xray.view);
  result.unobservable_room = unobservable_directions(views);
  for (std::size_t n = 3; n < parameters.size(); ++n) parameters[n] /= kLeverMm;
  result.renderer = renderer.kind();
  judge(parameters, options, result);
  result.seconds = seconds_since(begin);
  return result;
}

}  // namespace isoshift
