#pragma once
// Whether the views contradict each other: a patient who moved between them, a gantry angle, receptor or distance that
// is not what one of the files says, anatomy that moved against the rest (docs/algorithms.md, "Contradiction").

#include <vector>

#include "registration/search.h"

namespace isoshift {

// For each view: how far it alone would want anatomy from where all views together put it. The pose that the view alone
// wants is searched from the pose found, by gradient correlation; depth, which it hardly sees, is held by a weak
// spring. The distance is the root mean square over the 27 points {-50, 0, 50}^3 mm about the isocenter, as the view
// sees it: in mm at the isocenter. Its sigma is what the residuals of that view let expect of views that agree
// (uncertainty.h). Empty for a single view.
std::vector<Contradiction> contradictions(const RendererPyramid& renderers, const FixedViews& views,
                                          const Eigen::Isometry3d& planned_room_from_patient,
                                          const Eigen::Isometry3d& room_from_patient, const Stage& last_stage, Dof dof);

}  // namespace isoshift
