#include "registration/bodies/body_search.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/stopwatch.h"
#include "geometry/linear_algebra.h"
#include "registration/bodies/body_objective.h"
#include "registration/levenberg_marquardt.h"

namespace isoshift {
namespace {

constexpr int kParameters = PoseSlots::kParameters;

JointedBodies with_soft_tissue_held(JointedBodies bodies, double sigmas) {
  for (JointedBodies::Spring& spring : bodies.springs)
    if (bodies.bodies[spring.a].is_soft || bodies.bodies[spring.b].is_soft) {
      spring.sigma_mm *= sigmas;
      spring.sigma_rad *= sigmas;
    }
  return bodies;
}

// One climb of all slots from their base.
OptimizerResult climb_from_base(BodyObjective& objective, const PoseSlots& slots, const BodyStage& stage,
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

// The pixels that a stage compares.
Objective pixels_of(const BodyScene& scene, const BodyStage& stage) {
  const Eigen::Isometry3d& about = scene.whole_room_from_patient;
  return {*scene.of(stage).as_one,
          scene.views.reduced_to(stage.pixel_mm, about, 5.0),
          about,
          {.similarity = SimilarityKind::kGradientCorrelation,
           .pixel_fraction = stage.pixel_fraction,
           .min_pixels = static_cast<std::size_t>(stage.min_pixels)}};
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
  const double growth = generalized_eigenvalues(on_loose_springs, covariance).maxCoeff();
  return std::clamp((4.0 - growth) / 3.0, 0.0, 1.0);
}

std::vector<float> RenderedBodies::line_integrals(const Objective& pixels, const BodyPoses& poses,
                                                  std::size_t view) const {
  std::vector<float> drr(pixels.rendered_pixels(view).size());
  for (std::size_t body = 0; body < apart.count(); ++body)
    apart.add(body, pixels.views()[view], poses[body][view], pixels.rendered_pixels(view), drr);
  return drr;
}

std::vector<double> RenderedBodies::matches(std::span<const FixedImage> images, const BodyPoses& poses) const {
  const Objective pixels(*as_one, images, poses.front().front(), {.similarity = SimilarityKind::kGradientCorrelation});
  std::vector<double> matches;
  matches.reserve(images.size());
  for (std::size_t view = 0; view < images.size(); ++view)
    matches.push_back(pixels.comparison(view).of(line_integrals(pixels, poses, view)));
  return matches;
}

BodyPoses at_one_pose(const BodyScene& scene, const Eigen::Isometry3d& room_from_patient) {
  return BodyPoses(scene.bodies.bodies.size(),
                   std::vector<Eigen::Isometry3d>(scene.views.images.size(), room_from_patient));
}

BodySearchResult search_bodies(const BodyScene& scene, const BodyPoses& start, std::span<const BodyStage> stages,
                               double bound_mm) {
  BodySearchResult result{.poses = start};
  for (const BodyStage& stage : stages) {
    const Stopwatch watch;
    const Objective pixels = pixels_of(scene, stage);
    const JointedBodies held = with_soft_tissue_held(scene.bodies, stage.soft_sigmas);
    BodyObjective objective(held, scene.of(stage).apart, pixels, stage.tile_mm);
    const PoseSlots slots(scene.bodies, scene.fine.apart, result.poses);
    const OptimizerResult climbed = climb_from_base(objective, slots, stage, bound_mm);
    result.poses = slots.poses(climbed.best);
    result.log_probability = climbed.value;
    result.stages.push_back(report_of(stage, climbed, watch.seconds()));
  }
  return result;
}

BodyCertainty certainty_of(const BodyScene& scene, const BodyPoses& poses, const BodyStage& stage) {
  const Objective pixels = pixels_of(scene, stage);
  BodyObjective objective(scene.bodies, scene.of(stage).apart, pixels, stage.tile_mm);
  const PoseSlots slots(scene.bodies, scene.fine.apart, poses);
  const std::vector<double> at_base(kParameters * slots.count(), 0.0);
  const BodyObjective::Parts parts = objective.parts(slots, at_base);
  const QuadraticModel images = parts.of_all_views();
  const Eigen::MatrixXd motions = slots.motions_of_bodies(at_base);
  const Eigen::MatrixXd held = images.curvature + parts.springs.curvature;
  const Eigen::MatrixXd loose = images.curvature + 0.25 * parts.springs.curvature;
  return {.covariance = product(motions, solve_symmetric(held, motions.transpose())),
          .covariance_on_loose_springs = product(motions, solve_symmetric(loose, motions.transpose())),
          .motions_left = product(motions, solve_symmetric(held, images.gradient + parts.springs.gradient))};
}

}  // namespace isoshift
