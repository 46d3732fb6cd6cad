#pragma once
// Connected parts of a mask, and parts that only a narrow neck joins.

#include <cstdint>
#include <vector>

#include "geometry/volume.h"

namespace isoshift {

// A part: indices of its voxels, ascending.
using VoxelSet = std::vector<std::uint32_t>;

// The voxel of an index, in the order of Volume.
inline Eigen::Vector3i voxel_of(const Eigen::Vector3i& size, std::uint32_t index) {
  const auto columns = static_cast<std::uint32_t>(size.x()), rows = static_cast<std::uint32_t>(size.y());
  return {static_cast<int>(index % columns), static_cast<int>(index / columns % rows),
          static_cast<int>(index / (columns * rows))};
}

// Voxels that are not 0 and touch by a face, an edge or a corner; the largest part first. Parts with fewer than
// `least_voxels` are left out.
std::vector<VoxelSet> connected_parts(const Volume<std::uint8_t>& mask, std::size_t least_voxels);

// Parts of a mask by their depth below its surface: a watershed. Two deep places belong to different parts if the way
// between them is shallower than either of them by more than `neck_mm` and no deeper than 0.7 of the shallower one.
// `depth_mm` is 0 outside the mask.
std::vector<VoxelSet> parts_between_necks(const Volume<float>& depth_mm, double neck_mm);

}  // namespace isoshift
