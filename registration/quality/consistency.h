#pragma once
// Whether all parts of the views agree with the pose found: anatomy that moved against the target gives a wrong answer
// that restarts, curvature and similarity all confirm (docs/algorithms.md, "Regional consistency").

#include <Eigen/Geometry>
#include <vector>

#include "drr/renderer_pyramid.h"
#include "registration/search.h"

#include "setup/registration.h"

namespace isoshift {

// One per image.
std::vector<ViewConsistency> regional_consistency(const RendererPyramid& renderers, const FixedViews& fixed,
                                                  const Eigen::Isometry3d& room_from_patient);

}  // namespace isoshift
