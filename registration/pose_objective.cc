#include "registration/pose_objective.h"

#include "registration/pose_parameters.h"

namespace isoshift {

std::vector<QuadraticModel> PoseObjective::models(std::span<const std::vector<double>> points) {
  std::vector<QuadraticModel> models = objective_.models(poses_of(points));
  for (std::size_t n = 0; n < models.size(); ++n) models[n] = models[n].by(motions_per_parameter(points[n]));
  return models;
}

std::vector<Eigen::Isometry3d> PoseObjective::poses_of(std::span<const std::vector<double>> points) const {
  std::vector<Eigen::Isometry3d> poses;
  poses.reserve(points.size());
  for (const std::vector<double>& point : points) poses.push_back(setup_error_from_parameters(point) * pose_);
  return poses;
}

OptimizerKind possible_optimizer(OptimizerKind wanted, const Renderer& renderer, SimilarityKind similarity) {
  const bool can_climb = renderer.has_derivatives() && has_curvature(similarity);
  return wanted == OptimizerKind::kLevenbergMarquardt && !can_climb ? OptimizerKind::kBobyqa : wanted;
}

}  // namespace isoshift
