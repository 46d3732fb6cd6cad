#pragma once
// Whether X-rays show the target and its surroundings where a search has put them (setup/registration.h, TargetMatch).

#include "registration/bodies/body_search.h"
#include "setup/registration.h"

namespace isoshift {

TargetMatch match_near_target(const BodyScene& scene, const Eigen::Vector3d& target_room_mm, const BodyPoses& poses);

// The coarse ones of a patient as a whole, and the median part of all that the X-rays show of it.
struct CoarseMatch {
  double of_all = 0.0, of_parts = 0.0;
};
CoarseMatch match_near_target(const FixedViews& views, Renderer& renderer, const Eigen::Isometry3d& room_from_patient,
                              const Eigen::Vector3d& target_room_mm);
double match_of_parts_everywhere(const FixedViews& views, Renderer& renderer,
                                 const Eigen::Isometry3d& room_from_patient);

// Of two equally long lists of gradients, which have one scale between them: the correlation of the 70 % of the pixels
// that agree best; 0 where either is flat.
double trimmed_correlation(const Gradients& xray, const Gradients& drr);

}  // namespace isoshift
