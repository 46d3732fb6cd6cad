#pragma once
// Similarities as functions of parameters, and what climbs on them.

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "drr/renderer.h"
#include "registration/objective.h"
#include "registration/optimizer.h"

namespace isoshift {

// The objective at setup errors, given by parameters (pose_parameters.h), on top of a pose. Borrows both.
class PoseObjective {
 public:
  PoseObjective(Objective& objective, const Eigen::Isometry3d& room_from_patient)
      : objective_(objective), pose_(room_from_patient) {}

  std::vector<double> values(std::span<const std::vector<double>> points) {
    return objective_.values(poses_of(points));
  }
  // By the parameters. Needs a renderer with derivatives.
  std::vector<QuadraticModel> models(std::span<const std::vector<double>> points);

 private:
  std::vector<Eigen::Isometry3d> poses_of(std::span<const std::vector<double>> points) const;

  Objective& objective_;
  const Eigen::Isometry3d& pose_;
};

// Levenberg-Marquardt needs a renderer with derivatives and a similarity with a curvature; without them BOBYQA climbs
// instead.
OptimizerKind possible_optimizer(OptimizerKind wanted, const Renderer& renderer, SimilarityKind similarity);

// maximize() on the models of a function where its optimizer takes them and the renderer has them, else on its values:
// a PoseObjective, or a class with the same two functions.
template <class Function>
std::vector<OptimizerResult> maximize_poses(Function& function, const Renderer& renderer,
                                            std::span<const OptimizerOptions> searches) {
  using Points = std::span<const std::vector<double>>;
  const OptimizerKind kind = searches.front().kind;
  if (kind == OptimizerKind::kLevenbergMarquardt || (kind == OptimizerKind::kLbfgs && renderer.has_derivatives()))
    return maximize([&](Points points) { return function.models(points); }, searches);
  return maximize([&](Points points) { return function.values(points); }, searches);
}

}  // namespace isoshift
