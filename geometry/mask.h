#pragma once
// Regions of a volume: 1 inside, 0 outside.

#include <cstdint>

#include "geometry/volume.h"

namespace isoshift {

// All voxels whose center lies at most `margin_mm` from the center of a voxel of `mask`: exact on every lattice,
// sheared ones too. Throws UsageError for a margin that is negative or not finite.
Volume<std::uint8_t> dilated(const Volume<std::uint8_t>& mask, double margin_mm);

// The mean position of the voxels that are 1. Precondition: there is one.
Eigen::Vector3d centroid_patient_mm(const Volume<std::uint8_t>& mask);

// How far a point lies from the nearest center of a voxel that is 1; infinite if there is none.
double distance_mm(const Volume<std::uint8_t>& mask, const Eigen::Vector3d& point_patient_mm);

}  // namespace isoshift
