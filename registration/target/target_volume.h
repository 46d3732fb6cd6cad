#pragma once
// A target as a volume of the CT.

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "geometry/volume.h"
#include "setup/target.h"

namespace isoshift {

// What lies within 30 mm of the isocenter, where no structure is the target.
Target isocenter_surroundings();

// The volume of a mask (1 inside): its center and the points of its surface that lie farthest all around.
Target target_in(const Volume<std::uint8_t>& mask, const Eigen::Isometry3d& planned_room_from_patient);

// How far from a point a CT ends although the body goes on there, if that is at most 25 mm.
std::optional<double> end_of_ct_near_mm(const Volume<float>& ct_hu, const Eigen::Vector3d& point_patient_mm);

}  // namespace isoshift
