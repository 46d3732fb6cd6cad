#pragma once
// The CT on a coarse lattice of cubes along the patient's axes, whatever the axes of its voxels.

#include <Eigen/Geometry>

#include "geometry/volume.h"

namespace isoshift {

// Voxel edges are equal and parallel to the patient's axes: +i is left, +j posterior, +k superior.
// HU are averaged over blocks of the CT's voxels, then interpolated; -1000 outside the CT.
// Only the box that holds what is denser than -300 HU is kept. `edge_mm` becomes larger if the lattice would exceed
// `max_voxels`.
Volume<float> on_patient_axes(const Volume<float>& ct_hu, double edge_mm, double max_voxels = 24e6);

// Interpolated between the eight nearest voxel centers; `outside` beyond the outermost centers by more than half a
// voxel.
template <class T>
float interpolated(const Volume<T>& volume, const Eigen::Vector3d& at_voxel, float outside) {
  Eigen::Vector3i low;
  Eigen::Vector3f share;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(at_voxel[axis] >= -0.5 && at_voxel[axis] <= volume.size[axis] - 0.5)) return outside;
    const double inside = std::min(std::max(at_voxel[axis], 0.0), volume.size[axis] - 1.0);
    low[axis] = std::min(static_cast<int>(inside), std::max(volume.size[axis] - 2, 0));
    share[axis] = static_cast<float>(inside - low[axis]);
  }
  float sum = 0.0F;
  for (int n = 0; n < 8; ++n) {
    const Eigen::Vector3i step(n & 1, n >> 1 & 1, n >> 2 & 1);
    float weight = 1.0F;
    for (int axis = 0; axis < 3; ++axis) weight *= step[axis] != 0 ? share[axis] : 1.0F - share[axis];
    if (weight == 0.0F) continue;
    const Eigen::Vector3i at = low + step;
    sum += weight * static_cast<float>(volume.at(at.x(), at.y(), at.z()));
  }
  return sum;
}

}  // namespace isoshift
