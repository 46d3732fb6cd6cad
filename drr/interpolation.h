#pragma once
// Trilinear interpolation of volumes that fade to 0 over the voxel beyond their outermost voxel centers.

#include "geometry/volume.h"

namespace isoshift {

template <class T>
double voxel_or_zero(const Volume<T>& volume, const Eigen::Vector3i& at) {
  const bool inside = (at.array() >= 0).all() && (at.array() < volume.size.array()).all();
  return inside ? volume.at(at.x(), at.y(), at.z()) : 0.0;
}

// The value at `fraction` of the way from voxel `corner` to the next one along each axis, of voxels that a function
// gives.
template <class VoxelAt>
double interpolate_between(VoxelAt&& voxel_at, const Eigen::Vector3i& corner, const Eigen::Vector3d& fraction) {
  double value = 0.0;
  for (int n = 0; n < 8; ++n) {
    const Eigen::Vector3i offset(n & 1, (n >> 1) & 1, n >> 2);
    const Eigen::Vector3d distance = (fraction - offset.cast<double>()).cwiseAbs();
    value += (1.0 - distance.array()).prod() * voxel_at(corner + offset);
  }
  return value;
}

// The same of a volume.
template <class T>
double interpolate(const Volume<T>& volume, const Eigen::Vector3i& corner, const Eigen::Vector3d& fraction) {
  const bool inside = (corner.array() >= 0).all() && (corner.array() + 1 < volume.size.array()).all();
  if (!inside)
    return interpolate_between([&](const Eigen::Vector3i& at) { return voxel_or_zero(volume, at); }, corner, fraction);
  const auto along_row = [&](const T* at) { return at[0] + fraction.x() * (at[1] - at[0]); };
  const auto in_slice = [&](const T* at) {
    const double above = along_row(at);
    return above + fraction.y() * (along_row(at + volume.size.x()) - above);
  };
  const T* at = &volume.at(corner.x(), corner.y(), corner.z());
  const double below = in_slice(at);
  return below + fraction.z() * (in_slice(at + volume.index(0, 0, 1)) - below);
}

}  // namespace isoshift
