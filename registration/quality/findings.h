#pragma once
// Whether the numbers of a registration can be trusted.

#include <span>
#include <vector>

#include "registration/register_views.h"

namespace isoshift {

// Directions (unit vectors in the room) along which no view measures: the common viewing direction where all central
// rays lie within 30 degrees of each other, as with a single view.
std::vector<Eigen::Vector3d> unobservable_directions(std::span<const XrayView> views);

// Where the pose found puts the target: the isocenter if the options name none.
Eigen::Vector3d target_found_room_mm(const RegistrationOptions& options, const RegistrationResult& result);

// What speaks against the result, by everything that it holds and by the parameters of the pose found
// (pose_parameters.h): a function of measurements alone, whose limits are those of limits.h.
std::vector<Finding> findings_about(std::span<const double> parameters, const RegistrationOptions& options,
                                    const RegistrationResult& result);

}  // namespace isoshift
