#pragma once
// An owning 3D volume on a lattice in DICOM patient coordinates (LPS, mm).

#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

namespace isoshift {

// Voxel (i, j, k) = (column, row, slice) lies at index (k * size.y + j) * size.x + i; its center is at
// patient_from_voxel * (i, j, k). The axes may be oblique or, for a tilted gantry, sheared.
template <class T>
struct Volume {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  std::vector<T> voxels;

  Volume() = default;
  Volume(const Eigen::Vector3i& voxel_counts, const Eigen::Affine3d& lattice, T fill = T{})
      : size(voxel_counts), patient_from_voxel(lattice), voxels(voxel_counts.cast<std::size_t>().prod(), fill) {}

  std::size_t index(int i, int j, int k) const { return (static_cast<std::size_t>(k) * size.y() + j) * size.x() + i; }
  T& at(int i, int j, int k) { return voxels[index(i, j, k)]; }
  const T& at(int i, int j, int k) const { return voxels[index(i, j, k)]; }

  // The middle between the first and the last voxel's centers, patient axes.
  Eigen::Vector3d center_mm() const {
    return patient_from_voxel * Eigen::Vector3d(0.5 * (size.cast<double>().array() - 1.0));
  }

  // Edge lengths of one voxel along its own axes, mm.
  Eigen::Vector3d spacing_mm() const { return patient_from_voxel.linear().colwise().norm(); }
};

}  // namespace isoshift
