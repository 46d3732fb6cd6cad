#pragma once
// Which blocks of a volume hold anything: how all ray casters skip empty space.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "drr/quantized_volume.h"

namespace isoshift {

struct BlockGrid {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  std::vector<std::uint8_t> occupied;  // 1 or 0, x fastest

  bool at(int i, int j, int k) const {
    return occupied[(static_cast<std::size_t>(k) * size.y() + j) * size.x() + i] != 0;
  }
};

// Block b holds the voxels from b * edge to (b + 1) * edge - 1 along each axis.
BlockGrid occupied_blocks(const QuantizedVolume& volume, int edge);

// For trilinear interpolation: block b covers the positions from b * edge - 1 to (b + 1) * edge - 1 along each axis;
// outside of the occupied ones every interpolated value is 0.
BlockGrid interpolation_blocks(const QuantizedVolume& volume, int edge);

}  // namespace isoshift
