#pragma once
// How well bodies at some poses match the X-rays, and how much that strains the springs between them: a logarithm of
// probability, with its model.
//
// Gradient correlation rho of a list is least squares, 2 (1 - rho) = |x - y|^2 with both of unit norm. Residuals are
// alike over about 25 mm, so that a view has as many independent ones as tiles of that size; with their variance not
// known, the logarithm of the likelihood of n tiles is -n/2 ln(1 - rho). Half of n counts for the gradients along rows
// and half for those along columns. Springs are Gaussian.

#include <Eigen/Core>
#include <span>
#include <vector>

#include "registration/bodies/jointed_bodies.h"
#include "registration/bodies/pose_slots.h"
#include "registration/objective.h"

namespace isoshift {

class BodyObjective {
 public:
  // Compares the pixels that `pixels` compares, by gradient correlation. Borrows all.
  BodyObjective(const JointedBodies& bodies, const BodyRenderers& renderers, const Objective& pixels);

  // The model at some parameters of the slots. All tiles weigh the same until reweight().
  QuadraticModel model(const PoseSlots& slots, std::span<const double> parameters) const;

  // The same, taken apart.
  struct Parts {
    QuadraticModel images, springs;
  };
  Parts parts(const PoseSlots& slots, std::span<const double> parameters) const;

  // What does not fit must not pull: tiles whose unexplained share is k times as large as the median's, k > 1.5, weigh
  // (1.5 / k)^2 from now on.
  void reweight(const BodyPoses& poses);

 private:
  struct Drr {
    std::vector<float> line_integrals;
    PixelJacobian jacobian;  // by the parameters of all slots; empty if not wanted
  };
  // One direction of one view: what is compared there.
  struct List {
    std::size_t view;
    std::span<const float> xray;
    std::uint32_t Neighbors::* from;
    std::uint32_t Neighbors::* to;
  };

  Drr drr_of(std::size_t view, const BodyPoses& poses) const;
  Drr drr_with_jacobian(std::size_t view, const PoseSlots& slots, std::span<const double> parameters) const;
  QuadraticModel image_model(const PoseSlots& slots, std::span<const double> parameters) const;
  QuadraticModel spring_model(const PoseSlots& slots, std::span<const double> parameters) const;
  QuadraticModel list_model(const List& list, const Drr& drr) const;
  double tiles_counted(std::size_t view) const;

  const JointedBodies& bodies_;
  const BodyRenderers& renderers_;
  const Objective& pixels_;
  std::vector<List> lists_;
  std::vector<std::vector<std::size_t>> tile_of_;  // [view][compared pixel]
  std::vector<std::vector<double>> tile_weights_;  // [view][tile]
};

}  // namespace isoshift
