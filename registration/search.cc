#include "registration/search.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>

#include "base/error.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "registration/objective.h"
#include "registration/pose_objective.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

using Parameters = std::vector<double>;

constexpr double kMinFieldPixels = 900.0;  // of a view, if it has them

double field_pixels(const FixedImage& image) {
  return static_cast<double>(std::ranges::count_if(image.field.pixels, std::identity()));
}

// The largest reduction that keeps pixels at the isocenter within the stage's size, and enough of them in a small
// field.
int reduction(const FixedImage& image, double pixel_mm) {
  return std::max(1, static_cast<int>(std::min(pixel_mm * pixels_per_mm(image.view),
                                               std::sqrt(field_pixels(image) / kMinFieldPixels))));
}

// An image reduced and restricted. Where the region leaves few pixels, they are as many times finer as makes up for
// that.
FixedImage compared_part(const FixedImage& image, const ProjectedRegion& region, double pixel_mm,
                         const Eigen::Isometry3d& room_from_patient, double slack_mm) {
  int factor = reduction(image, pixel_mm);
  for (;;) {
    FixedImage part = reduced(image, factor);
    region.restrict(part, room_from_patient, slack_mm);
    const double left = field_pixels(part);
    if (left >= kMinFieldPixels || factor == 1 || field_pixels(image) < kMinFieldPixels) return part;
    factor = std::clamp(static_cast<int>(factor * std::sqrt(left / kMinFieldPixels)), 1, factor - 1);
  }
}

double bound_of(std::size_t axis, const SearchOptions& options) {
  return axis < 3 ? options.bound_mm : options.bound_rad * kLeverMm;
}

OptimizerOptions optimizer_options(const Stage& stage, OptimizerKind kind, const SearchOptions& options,
                                   const Parameters& start) {
  OptimizerOptions from_start{.kind = kind,
                              .start = start,
                              .relative_tolerance = stage.relative_tolerance,
                              .max_evaluations = stage.max_evaluations};
  for (std::size_t axis = 0; axis < start.size(); ++axis) {
    from_start.lower.push_back(-bound_of(axis, options));
    from_start.upper.push_back(bound_of(axis, options));
    from_start.initial_step.push_back(axis < 3 ? stage.initial_step_mm : stage.initial_step_rad * kLeverMm);
  }
  return from_start;
}

// Poses drawn around one.
std::vector<Parameters> candidates_about(const Parameters& pose, const Stage& stage, const SearchOptions& options,
                                         std::mt19937_64& random) {
  std::vector<Parameters> candidates;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (int n = 0; n < stage.candidates; ++n) {
    Parameters candidate = pose;
    for (std::size_t axis = 0; axis < candidate.size(); ++axis) {
      const double reach = axis < 3 ? stage.reach_mm : stage.reach_rad * kLeverMm;
      const double bound = bound_of(axis, options);
      candidate[axis] = std::clamp(candidate[axis] + reach * uniform(random), -bound, bound);
    }
    candidates.push_back(candidate);
  }
  return candidates;
}

StageReport report_of(const Stage& stage, OptimizerKind optimizer) {
  return {.name = stage.name,
          .similarity = std::string(to_string(stage.similarity)),
          .optimizer = std::string(to_string(optimizer)),
          .parameters = {{"pixel_mm", stage.pixel_mm},
                         {"voxel_mm", stage.voxel_mm},
                         {"pixel_fraction", stage.pixel_fraction},
                         {"min_pixels", stage.min_pixels},
                         {"candidates", stage.candidates},
                         {"starts", stage.starts},
                         {"keep", stage.keep},
                         {"reach_mm", stage.reach_mm},
                         {"reach_rad", stage.reach_rad},
                         {"initial_step_mm", stage.initial_step_mm},
                         {"initial_step_rad", stage.initial_step_rad},
                         {"relative_tolerance", stage.relative_tolerance},
                         {"max_evaluations", stage.max_evaluations}}};
}

// A stage's similarity, which notes its best values.
class StageObjective {
 public:
  StageObjective(Objective& objective, const Eigen::Isometry3d& start_room_from_patient, StageReport& report)
      : poses_(objective, start_room_from_patient), report_(report) {}

  std::vector<double> values(std::span<const Parameters> points) {
    std::vector<double> values = poses_.values(points);
    for (const double value : values) note(value);
    return values;
  }

  std::vector<QuadraticModel> models(std::span<const Parameters> points) {
    std::vector<QuadraticModel> models = poses_.models(points);
    for (const QuadraticModel& model : models) note(model.value);
    return models;
  }

 private:
  void note(double value) {
    report_.best.push_back(report_.best.empty() ? value : std::max(value, report_.best.back()));
  }

  PoseObjective poses_;
  StageReport& report_;
};

// The best of some poses.
std::vector<Parameters> best_of(std::vector<Parameters> poses, std::size_t count, StageObjective& objective,
                                int& evaluations) {
  if (poses.size() <= count) return poses;
  if (count == 0) return {};
  const std::vector<double> values = objective.values(poses);
  evaluations += static_cast<int>(values.size());
  std::vector<std::size_t> order(poses.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, std::greater(), [&](std::size_t n) { return values[n]; });
  std::vector<Parameters> best;
  best.reserve(count);
  for (std::size_t n = 0; n < count; ++n) best.push_back(poses[order[n]]);
  return best;
}

// `found` is sorted, best first.
void report_spread(const std::vector<OptimizerResult>& found, StageReport& report) {
  if (found.size() < 2) return;
  constexpr double kClearlyMore = 1.1;
  const OptimizerResult& best = found.front();
  report.spread_mm = report.spread_rad = 0.0;
  for (const OptimizerResult& other : found) {
    if (1.0 - other.value > kClearlyMore * (1.0 - best.value)) continue;
    const PoseDistance distance = distance_between(other.best, best.best);
    report.spread_mm = std::max(*report.spread_mm, distance.translation_mm);
    report.spread_rad = std::max(*report.spread_rad, distance.angle_rad);
  }
}

}  // namespace

std::vector<FixedImage> FixedViews::reduced_to(double pixel_mm, const Eigen::Isometry3d& room_from_patient,
                                               double slack_mm) const {
  std::vector<FixedImage> level(images.size());
  parallel_for(std::size_t{0}, images.size(), [&](std::size_t view) {
    level[view] = compared_part(images[view], region, pixel_mm, room_from_patient, slack_mm);
  });
  return level;
}

SearchResult search(const RendererPyramid& renderers, const FixedViews& views,
                    const Eigen::Isometry3d& start_room_from_patient, const SearchOptions& options,
                    const SearchProgress& progress) {
  SearchResult result;
  std::vector<Parameters> kept = {options.parameters};
  if (options.parameters.empty()) kept.front().resize(options.dof == Dof::kRigid ? 6 : 3, 0.0);
  std::mt19937_64 random(options.seed);
  for (const Stage& stage : options.stages) {
    const Stopwatch watch;
    const Eigen::Isometry3d about = setup_error_from_parameters(kept.front()) * start_room_from_patient;
    const std::vector<FixedImage> level = views.reduced_to(stage.pixel_mm, about, stage.initial_step_mm);
    Renderer& renderer = renderers.with_voxels_up_to(stage.voxel_mm);
    Objective objective(renderer, level, about,
                        {.similarity = stage.similarity,
                         .pixel_fraction = stage.pixel_fraction,
                         .min_pixels = static_cast<std::size_t>(stage.min_pixels),
                         .seed = options.seed});
    const OptimizerKind optimizer = possible_optimizer(stage.optimizer, renderer, stage.similarity);
    StageReport report = report_of(stage, optimizer);
    StageObjective similarity(objective, start_room_from_patient, report);

    const std::size_t more = static_cast<std::size_t>(stage.starts) - std::min<std::size_t>(stage.starts, kept.size());
    std::ranges::copy(
        best_of(candidates_about(kept.front(), stage, options, random), more, similarity, report.evaluations),
        std::back_inserter(kept));
    std::vector<OptimizerOptions> searches;
    searches.reserve(kept.size());
    for (const Parameters& start : kept) searches.push_back(optimizer_options(stage, optimizer, options, start));
    std::vector<OptimizerResult> found = maximize_poses(similarity, renderer, searches);
    std::ranges::stable_sort(found, std::greater(), &OptimizerResult::value);
    kept.clear();
    for (const OptimizerResult& end : found) {
      report.evaluations += end.evaluations;
      if (static_cast<int>(kept.size()) < stage.keep) kept.push_back(end.best);
    }
    report.value = found.front().value;
    report.termination = found.front().termination;
    report.reached_limit = found.front().reached_limit;
    if (stage.keep == 1) report_spread(found, report);  // several that are kept may differ
    report.seconds = watch.seconds();
    result.stages.push_back(report);
    result.seconds_rendering += objective.seconds().rendering;
    result.seconds_similarity += objective.seconds().similarity;
    if (progress) progress(static_cast<double>(result.stages.size()) / static_cast<double>(options.stages.size()));
  }
  result.parameters = kept.front();
  return result;
}

std::optional<SearchResult> search_if_possible(const RendererPyramid& renderers, const FixedViews& views,
                                               const Eigen::Isometry3d& start_room_from_patient,
                                               const SearchOptions& options) {
  try {
    return search(renderers, views, start_room_from_patient, options);
  } catch (const Error&) {
    return std::nullopt;
  }
}

}  // namespace isoshift
