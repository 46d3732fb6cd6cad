#pragma once
// Euclidean distances on a lattice of cubes.

#include <cstdint>

#include "geometry/volume.h"

namespace isoshift {

// From each voxel to the nearest center of a voxel where `is_target` is not 0, mm; 1e9 if there is none. Exact:
// Felzenszwalb and Huttenlocher, Theory of Computing 8 (2012) 415, one axis after the other. Voxels are cubes.
Volume<float> distance_mm(const Volume<std::uint8_t>& is_target);

// How deep each voxel of a mask lies in it: its distance from the nearest voxel outside; 0 outside.
Volume<float> depth_mm(const Volume<std::uint8_t>& mask);

}  // namespace isoshift
