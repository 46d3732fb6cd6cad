#pragma once
// Whether the numbers of a registration can be trusted.

#include <span>

#include "registration/register_views.h"

namespace isoshift {

// Directions (unit vectors in the room) along which no view measures: the common viewing direction where all central
// rays lie within 30 degrees of each other, as with a single view.
std::vector<Eigen::Vector3d> unobservable_directions(std::span<const XrayView> views);

// Where the pose found puts the target: the isocenter if the options name none.
Eigen::Vector3d target_found_room_mm(const RegistrationOptions& options, const RegistrationResult& result);

// What is asked of an answer for the target. Other patients whose bones were free to follow had at most 0.87 within 40
// mm, real spines searched a vertebra off 0.76; targets on jaws that had opened by 14 to 20 degrees passed that, but
// had at most 0.62 within 20 mm. Right patients had 0.92 and 0.79 and more, but for effusions that fill a view.
inline constexpr TargetMatch kLeastTargetMatch = {.of_surroundings = 0.9, .of_target = 0.7};
bool is_enough(const TargetMatch& match);

// Sets verdict and reasons from everything else in the result, and from the parameters of the pose found
// (pose_parameters.h).
void judge(std::span<const double> parameters, const RegistrationOptions& options, RegistrationResult& result);

}  // namespace isoshift
