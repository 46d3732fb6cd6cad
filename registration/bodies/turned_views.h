#pragma once
// Whether bodies moved, or one view was taken at another angle than its file says.

#include "registration/bodies/body_search.h"
#include "registration/quality/contradiction.h"

namespace isoshift {

// A gantry angle that is wrong in one view looks like bones that moved, where they lie far from each other. So each
// view is given a pose of its own of the rigid patient: the most probable one in that view alone. The share of what
// these poses gain in probability over the whole patient's pose (in nats), of what bodies gain that were found at
// `found`, less what their springs cost. Where bodies gain nothing, 1.
double share_explained_by_turn(const BodyScene& scene, const TurnBetweenViews& turn, const BodyPoses& found);

}  // namespace isoshift
