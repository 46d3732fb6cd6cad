#pragma once
// Whether X-rays show the target's surroundings where a search has put them.

#include "registration/bodies/body_search.h"

namespace isoshift {

struct TargetMatch {
  // Gradient correlation near the target, mean over the views. On coarse pixels noise hardly counts: what does not
  // match there is other anatomy, or the same anatomy with other contrast.
  double of_all = 0.0;
  // The same of small parts, each for itself: their median in a view, weighted by the gradients that the DRR has
  // there. Contrast that has changed spoils the parts that show its edges, another patient's anatomy spoils most.
  double of_parts = 0.0;
};

// Of what lies within 40 mm of the target; in small fields that show too little of it, of all that they show.
TargetMatch match_near_target(const BodyScene& scene, const Eigen::Vector3d& target_room_mm, const BodyPoses& poses);

// The same of a patient as a whole, and of all that the X-rays show of it.
TargetMatch match_near_target(const FixedViews& views, Renderer& renderer, const Eigen::Isometry3d& room_from_patient,
                              const Eigen::Vector3d& target_room_mm);
TargetMatch match_everywhere(const FixedViews& views, Renderer& renderer, const Eigen::Isometry3d& room_from_patient);

}  // namespace isoshift
