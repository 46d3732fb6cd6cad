#pragma once
// Boxes and blocks of voxels.

#include <Eigen/Geometry>
#include <algorithm>
#include <mutex>

#include "base/parallel.h"

namespace isoshift {

// Bounds included. Empty if first lies above last.
struct VoxelBox {
  Eigen::Vector3i first, last;
  Eigen::Vector3i size() const { return last.array() - first.array() + 1; }
  bool is_empty() const { return (first.array() > last.array()).any(); }
};

// The box of the voxels that are not 0, of voxels in the order of Volume.
template <class T>
VoxelBox occupied_voxels(const T* voxels, const Eigen::Vector3i& size) {
  VoxelBox box{.first = size, .last = Eigen::Vector3i::Constant(-1)};
  std::mutex mutex;
  parallel_for(0, size.z(), [&](int k) {
    VoxelBox of_slice{.first = size, .last = Eigen::Vector3i::Constant(-1)};
    for (int j = 0; j < size.y(); ++j) {
      const T* row = voxels + (static_cast<std::size_t>(k) * size.y() + j) * size.x();
      const T* const end = row + size.x();
      const T* const first = std::find_if(row, end, [](T value) { return value != T{}; });
      if (first == end) continue;
      const T* last = end - 1;
      while (*last == T{}) --last;
      of_slice.first = of_slice.first.cwiseMin(Eigen::Vector3i(static_cast<int>(first - row), j, k));
      of_slice.last = of_slice.last.cwiseMax(Eigen::Vector3i(static_cast<int>(last - row), j, k));
    }
    const std::scoped_lock lock(mutex);
    box.first = box.first.cwiseMin(of_slice.first);
    box.last = box.last.cwiseMax(of_slice.last);
  });
  return box;
}

// Blocks of voxels about as large as an edge, per axis; at least one voxel, at most all of them.
inline Eigen::Vector3i block_of(const Eigen::Vector3d& spacing_mm, const Eigen::Vector3i& size, double edge_mm) {
  constexpr double kRounding = 1.01;
  return (kRounding * edge_mm / spacing_mm.array()).cast<int>().max(1).min(size.array());
}

// From the lattice of such blocks to that of their voxels: block 0 lies in the middle of the first voxels.
inline Eigen::Affine3d voxel_from_block(const Eigen::Vector3i& block) {
  Eigen::Affine3d result = Eigen::Affine3d::Identity();
  result.linear() = block.cast<double>().asDiagonal();
  result.translation() = 0.5 * (block.array() - 1).cast<double>();
  return result;
}

}  // namespace isoshift
