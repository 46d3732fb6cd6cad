#pragma once
// Large bones as pieces of limited size.

#include "bodies/components.h"

namespace isoshift {

// Compact pieces of a set of voxels, each within a ball of `most_mm` diameter about its center.
std::vector<VoxelSet> pieces_of(const VoxelSet& voxels, const Eigen::Vector3i& lattice_size, double edge_mm,
                                double most_mm);

}  // namespace isoshift
