#pragma once
// How well bodies at some poses match the X-rays, and how much that strains the springs between them: a logarithm of
// probability, with its model.
//
// Gradient correlation rho of two lists is least squares, 2 (1 - rho) = |x - y|^2 with both of unit norm. A tile
// counts as one independent residual. Its variance is the tile's own and
// is not known: what the DRR cannot show (bowel, metal, a heart that beats) explains a tile badly whatever the pose is,
// and must not pull. So the logarithm of the likelihood of n residuals is -n/2 ln(1 - rho), tile by tile; half of it
// for the gradients along rows and half for those along columns. Springs are Gaussian. Bodies that hardly moved from
// one call to the next are not rendered again (MovingBodies).

#include <Eigen/Core>
#include <span>
#include <vector>

#include "registration/bodies/jointed_bodies.h"
#include "registration/bodies/moving_bodies.h"
#include "registration/bodies/pose_slots.h"
#include "registration/objective.h"
#include "registration/similarity/tiles.h"

namespace isoshift {

// What holds a motion that one view alone does not see: nats per mm^2 at the lever, 1 at 14 mm.
inline constexpr double kSpringOfOneView = 0.01;

class BodyObjective {
 public:
  // Compares the pixels that `pixels` compares, by gradient correlation, in tiles with this edge at the isocenter.
  // Borrows all.
  BodyObjective(const JointedBodies& bodies, const BodyRenderers& renderers, const Objective& pixels, double tile_mm);

  // The model at some parameters of the slots.
  QuadraticModel model(const PoseSlots& slots, std::span<const double> parameters);

  // The same, taken apart.
  struct Parts {
    std::vector<QuadraticModel> views;
    QuadraticModel springs;
    QuadraticModel of_all_views() const;
  };
  Parts parts(const PoseSlots& slots, std::span<const double> parameters);

 private:
  // Tiles that follow each other in one view.
  struct Run {
    std::size_t view = 0;
    std::vector<Tile> tiles;
  };

  std::vector<QuadraticModel> view_models(const PoseSlots& slots, std::span<const double> parameters);
  QuadraticModel spring_model(const PoseSlots& slots, std::span<const double> parameters) const;
  void add_tile(std::size_t view, const Tile& tile, const PoseSlots& slots, QuadraticModel& by_motions) const;

  const JointedBodies& bodies_;
  const Objective& pixels_;
  std::vector<Run> runs_;
  std::vector<MovingBodies> drrs_;  // of the views
};

}  // namespace isoshift
