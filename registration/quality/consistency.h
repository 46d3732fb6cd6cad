#pragma once
// Whether all parts of the views agree with the pose found: anatomy that moved against the target gives a wrong answer
// that restarts, curvature and similarity all confirm (docs/algorithms.md, "Regional consistency").

#include <Eigen/Geometry>
#include <vector>

#include "drr/renderer_pyramid.h"
#include "registration/search.h"

namespace isoshift {

// A square of a view, and where it matches the DRR best within a search distance.
struct Tile {
  Eigen::Vector2d center_px = Eigen::Vector2d::Zero();  // in the X-ray as acquired
  double width_px = 0.0;
  Eigen::Vector2d displacement_mm = Eigen::Vector2d::Zero();  // along columns and rows, at the isocenter
  double correlation = 0.0;                                   // of X-ray and DRR where the pose puts it
  double best_correlation = 0.0;                              // where it matches best
  bool has_signal = false;                                    // it matches clearly somewhere
  bool disagrees = false;                                     // and that is not where the pose puts it
};

struct ViewConsistency {
  std::vector<Tile> tiles;
  int with_signal() const;
  int disagreeing() const;
};

// One per image.
std::vector<ViewConsistency> regional_consistency(const RendererPyramid& renderers, const FixedViews& fixed,
                                                  const Eigen::Isometry3d& room_from_patient);

}  // namespace isoshift
