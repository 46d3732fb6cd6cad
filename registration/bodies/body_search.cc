#include "registration/bodies/body_search.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>

#include "registration/bodies/body_objective.h"
#include "registration/levenberg_marquardt.h"

namespace isoshift {
namespace {

constexpr int kParameters = PoseSlots::kParameters;

BodyPoses all_at(const Eigen::Isometry3d& pose, std::size_t bodies, std::size_t views) {
  return BodyPoses(bodies, std::vector<Eigen::Isometry3d>(views, pose));
}

JointedBodies with_soft_tissue_held(JointedBodies bodies, double sigmas) {
  for (JointedBodies::Spring& spring : bodies.springs)
    if (bodies.bodies[spring.a].is_soft || bodies.bodies[spring.b].is_soft) {
      spring.sigma_mm *= sigmas;
      spring.sigma_rad *= sigmas;
    }
  return bodies;
}

// One climb of all slots from their base.
OptimizerResult climb_from_base(const BodyObjective& objective, const PoseSlots& slots, const BodyStage& stage,
                                double bound_mm) {
  const std::size_t count = kParameters * slots.count();
  const OptimizerOptions options{.kind = OptimizerKind::kLevenbergMarquardt,
                                 .start = std::vector<double>(count, 0.0),
                                 .lower = std::vector<double>(count, -bound_mm),
                                 .upper = std::vector<double>(count, bound_mm),
                                 .initial_step = std::vector<double>(count, stage.initial_step_mm),
                                 .relative_tolerance = 0.01,
                                 .least_gain = stage.least_gain,
                                 .max_evaluations = stage.max_evaluations};
  const BatchModel models = [&](std::span<const std::vector<double>> points) {
    std::vector<QuadraticModel> result;
    for (const std::vector<double>& point : points) result.push_back(objective.model(slots, point));
    return result;
  };
  return climb(models, std::span(&options, 1)).front();
}

// What is known about the bodies where they were found.
void report_certainty(const BodyObjective& objective, const PoseSlots& slots, BodySearchResult& result) {
  const std::vector<double> at_base(kParameters * slots.count(), 0.0);
  const BodyObjective::Parts parts = objective.parts(slots, at_base);
  const QuadraticModel images = parts.of_all_views();
  const Eigen::MatrixXd motions = slots.motions_of_bodies(at_base);
  const Eigen::MatrixXd whole = images.curvature + parts.springs.curvature;
  const auto solver = whole.ldlt();
  result.motions_left = motions * solver.solve(images.gradient + parts.springs.gradient);
  result.covariance = motions * solver.solve(motions.transpose());
  const Eigen::MatrixXd loose = images.curvature + 0.25 * parts.springs.curvature;
  result.covariance_on_loose_springs = motions * loose.ldlt().solve(motions.transpose());
}

StageReport report_of(const BodyStage& stage, const OptimizerResult& climbed, double seconds) {
  return {.name = fmt::format("bodies {} mm", stage.pixel_mm),
          .similarity = std::string(to_string(SimilarityKind::kGradientCorrelation)),
          .optimizer = std::string(to_string(OptimizerKind::kLevenbergMarquardt)),
          .parameters = {{"pixel_mm", stage.pixel_mm},
                         {"pixel_fraction", stage.pixel_fraction},
                         {"tile_mm", stage.tile_mm},
                         {"initial_step_mm", stage.initial_step_mm}},
          .evaluations = climbed.evaluations,
          .seconds = seconds,
          .value = climbed.value,
          .termination = climbed.termination,
          .reached_limit = climbed.reached_limit};
}

}  // namespace

double image_share(const Eigen::Matrix3d& covariance, const Eigen::Matrix3d& on_loose_springs) {
  // Variances of what images alone show do not grow; those of what springs alone hold grow fourfold.
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix3d> growth(on_loose_springs, covariance,
                                                                         Eigen::EigenvaluesOnly);
  return std::clamp((4.0 - growth.eigenvalues().maxCoeff()) / 3.0, 0.0, 1.0);
}

BodySearchResult search_bodies(const BodyScene& scene, const Eigen::Isometry3d& whole_room_from_patient,
                               const BodySearchOptions& options, const SearchProgress& progress) {
  BodySearchResult result;
  result.poses = all_at(whole_room_from_patient, scene.bodies.bodies.size(), scene.views.images.size());
  for (const BodyStage& stage : options.stages) {
    const auto begin = std::chrono::steady_clock::now();
    const std::vector<FixedImage> images = scene.views.reduced_to(stage.pixel_mm, whole_room_from_patient, 5.0);
    const Objective pixels(scene.whole, images, whole_room_from_patient,
                           {.similarity = SimilarityKind::kGradientCorrelation,
                            .pixel_fraction = stage.pixel_fraction,
                            .min_pixels = static_cast<std::size_t>(stage.min_pixels)});
    const JointedBodies held = with_soft_tissue_held(scene.bodies, stage.soft_sigmas);
    const BodyObjective objective(held, scene.renderers, pixels, stage.tile_mm);
    const PoseSlots slots(scene.bodies, scene.renderers, result.poses);
    const OptimizerResult climbed = climb_from_base(objective, slots, stage, options.bound_mm);
    result.poses = slots.poses(climbed.best);
    if (&stage == &options.stages.front()) result.poses_after_first_stage = result.poses;
    const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
    result.stages.push_back(report_of(stage, climbed, seconds.count()));
    if (progress) progress(static_cast<double>(result.stages.size()) / static_cast<double>(options.stages.size()));
    if (&stage == &options.stages.back())
      report_certainty(objective, PoseSlots(scene.bodies, scene.renderers, result.poses), result);
  }
  return result;
}

}  // namespace isoshift
