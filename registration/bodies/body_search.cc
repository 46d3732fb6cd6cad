#include "registration/bodies/body_search.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <chrono>
#include <set>

#include "geometry/voxel_box.h"
#include "registration/bodies/body_objective.h"
#include "registration/levenberg_marquardt.h"

namespace isoshift {
namespace {

constexpr int kParameters = PoseSlots::kParameters;

std::vector<Beam> beams_of(std::span<const FixedImage> images) {
  std::set<Beam> beams;
  for (const FixedImage& image : images) beams.insert(image.view.beam);
  return {beams.begin(), beams.end()};
}

BodyPoses all_at(const Eigen::Isometry3d& pose, std::size_t bodies, std::size_t views) {
  return BodyPoses(bodies, std::vector<Eigen::Isometry3d>(views, pose));
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
                                 .relative_tolerance = 0.02,
                                 .max_evaluations = stage.max_evaluations};
  const BatchModel models = [&](std::span<const std::vector<double>> points) {
    std::vector<QuadraticModel> result;
    for (const std::vector<double>& point : points) result.push_back(objective.model(slots, point));
    return result;
  };
  return climb(models, std::span(&options, 1)).front();
}

// The smallest share of `part` in `whole`, over all directions; `whole` is positive definite.
double least_share(const Eigen::Matrix<double, 6, 6>& part, const Eigen::Matrix<double, 6, 6>& whole) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(part, whole,
                                                                                    Eigen::EigenvaluesOnly);
  return std::clamp(eigen.eigenvalues().minCoeff(), 0.0, 1.0);
}

std::vector<FoundBody> found_at_base(const BodyObjective& objective, const PoseSlots& slots, const BodyPoses& poses) {
  const std::vector<double> at_base(kParameters * slots.count(), 0.0);
  const BodyObjective::Parts parts = objective.parts(slots, at_base);
  const Eigen::MatrixXd& images = parts.images.curvature;
  const Eigen::MatrixXd whole = images + parts.springs.curvature;
  const Eigen::MatrixXd covariance = whole.ldlt().solve(Eigen::MatrixXd::Identity(whole.rows(), whole.cols()));
  std::vector<FoundBody> found;
  for (std::size_t body = 0; body < poses.size(); ++body) {
    const std::size_t slot = slots.of(body, 0);
    const auto at = static_cast<Eigen::Index>(kParameters * slot);
    const Eigen::Matrix<double, 6, 6> motions = slots.motions(slot, at_base);
    found.push_back({.room_from_patient = poses[body].front(),
                     .covariance = motions * covariance.block<6, 6>(at, at) * motions.transpose(),
                     .image_share = least_share(images.block<6, 6>(at, at), whole.block<6, 6>(at, at))});
  }
  return found;
}

}  // namespace

BodySearchResult search_bodies(const JointedBodies& bodies, const Volume<float>& ct_hu, const AttenuationModel& model,
                               const FixedViews& views, const Eigen::Isometry3d& whole_room_from_patient,
                               const BodySearchOptions& options) {
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<Beam> beams = beams_of(views.images);
  const CoarserCt coarser = coarser_ct(ct_hu, model, block_of(ct_hu.spacing_mm(), ct_hu.size, options.voxel_mm));
  const BodyRenderers renderers(RendererKind::kCpu, coarser.hu, coarser.model, beams, bodies.shares);
  const auto whole = make_renderer(RendererKind::kCpu, coarser.hu, coarser.model, beams);

  BodySearchResult result;
  result.poses = all_at(whole_room_from_patient, bodies.bodies.size(), views.images.size());
  for (const BodyStage& stage : options.stages) {
    const std::vector<FixedImage> images = views.reduced_to(stage.pixel_mm, whole_room_from_patient, 5.0);
    const Objective pixels(*whole, images, whole_room_from_patient,
                           {.similarity = SimilarityKind::kGradientCorrelation,
                            .pixel_fraction = stage.pixel_fraction,
                            .min_pixels = static_cast<std::size_t>(stage.min_pixels)});
    BodyObjective objective(bodies, renderers, pixels);
    for (int n = 0; n < stage.climbs; ++n) {
      const bool is_first = n == 0 && &stage == &options.stages.front();
      if (!is_first) objective.reweight(result.poses);  // at first nothing fits yet
      const PoseSlots slots(bodies, renderers, result.poses);
      const OptimizerResult climbed = climb_from_base(objective, slots, stage, options.bound_mm);
      result.evaluations += climbed.evaluations;
      result.poses = slots.poses(climbed.best);
    }
    if (&stage == &options.stages.back())
      result.bodies = found_at_base(objective, PoseSlots(bodies, renderers, result.poses), result.poses);
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace isoshift
