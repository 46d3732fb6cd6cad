#pragma once
// How much each place moves with each body: weights that sum to 1 everywhere, for rendering and for displacements.

#include <cstdint>
#include <vector>

#include "bodies/body_map.h"

namespace isoshift {

// Of one body: weight / 255 in the voxels of a box on the masks' lattice; 0 outside the box.
struct SoftMask {
  int body = -1;                                    // index into BodyMap::bodies
  Eigen::Vector3i first = Eigen::Vector3i::Zero();  // of the box, a voxel of the lattice
  Volume<std::uint8_t> weight;                      // the box, with its own patient_from_voxel
};

struct SoftMasks {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();  // of the lattice on which all boxes lie
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  std::vector<SoftMask> masks;  // of the bodies that have voxels, without the couch
  Volume<float> to_bone_mm;     // on the lattice: distance from the nearest body, 0 in it
};

// The lattice is that of the labels in blocks of `block` voxels along every axis. In a body's own bone its weight is 1.
// In soft tissue the weights follow the distances d to the bodies: each is proportional to (max(0, D + T - d) / d)^2
// with D the least distance and T the transition. So a body counts only where it is at most T farther than the nearest
// one. In every voxel of the lattice the weights sum to 255 exactly.
SoftMasks soft_masks(const BodyMap& map, int block = 2, double transition_mm = 20.0);

}  // namespace isoshift
