#pragma once
// Whether X-rays show the target and its surroundings where a search has put them (setup/registration.h, TargetMatch).

#include <optional>

#include "registration/bodies/body_search.h"
#include "registration/search.h"
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

// What surrounds the target: as far as this from it in the images, at the isocenter.
inline constexpr double kAboutTargetMm = 40.0;

// Where the target would lie if only what the X-rays show of its surroundings counted: the last stage of a search
// climbs there from the pose found. Nothing where too little is shown.
std::optional<Eigen::Vector3d> place_wanted_near_target(const RendererPyramid& renderers, const FixedViews& views,
                                                        const Eigen::Isometry3d& room_from_patient,
                                                        const Eigen::Vector3d& target_room_mm,
                                                        const SearchOptions& options);

// Of two equally long lists of gradients, which have one scale between them: the correlation of the 70 % of the pixels
// that agree best; 0 where either is flat.
double trimmed_correlation(const Gradients& xray, const Gradients& drr);

}  // namespace isoshift
