#include "bodies/lattice.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "geometry/voxel_box.h"

namespace isoshift {
namespace {

constexpr float kAirHu = -1000.0F;

// Averages of whole blocks; what does not fill a block at the far faces is left out.
Volume<float> in_blocks(const Volume<float>& ct_hu, const Eigen::Vector3i& block) {
  const Eigen::Vector3i size = ct_hu.size.array() / block.array();
  Volume<float> coarse(size, ct_hu.patient_from_voxel * voxel_from_block(block));
  const float share = 1.0F / static_cast<float>(block.prod());
  parallel_for(0, size.z(), [&](int k) {
    for (int z = 0; z < block.z(); ++z)
      for (int j = 0; j < size.y() * block.y(); ++j) {
        const float* from = &ct_hu.at(0, j, k * block.z() + z);
        float* to = &coarse.at(0, j / block.y(), k);
        for (int i = 0; i < size.x(); ++i)
          for (int x = 0; x < block.x(); ++x) to[i] += share * *from++;
      }
  });
  return coarse;
}

// The patient-axes box of the voxels denser than -300 HU, half a voxel beyond their centers.
Eigen::AlignedBox3d dense_box(const Volume<float>& hu) {
  constexpr float kDenseHu = -300.0F;
  std::vector<Eigen::AlignedBox3d> of_slice(static_cast<std::size_t>(hu.size.z()));
  parallel_for(0, hu.size.z(), [&](int k) {
    for (int j = 0; j < hu.size.y(); ++j) {
      const float* row = &hu.at(0, j, k);
      const float* first = std::find_if(row, row + hu.size.x(), [](float value) { return value > kDenseHu; });
      if (first == row + hu.size.x()) continue;
      int last = hu.size.x() - 1;
      while (row[last] <= kDenseHu) --last;
      for (const double i : {static_cast<double>(first - row), static_cast<double>(last)})
        of_slice[k].extend(hu.patient_from_voxel * Eigen::Vector3d(i, j, k));
    }
  });
  Eigen::AlignedBox3d box;
  for (const Eigen::AlignedBox3d& slice : of_slice) box.extend(slice);
  if (box.isEmpty()) return box;
  const Eigen::Vector3d half = 0.5 * hu.patient_from_voxel.linear().cwiseAbs().rowwise().sum();
  return {box.min() - half, box.max() + half};
}

}  // namespace

Volume<float> on_patient_axes(const Volume<float>& ct_hu, double edge_mm, double max_voxels) {
  const Eigen::Vector3i block = block_of(ct_hu.spacing_mm(), ct_hu.size, edge_mm);
  const Volume<float> blocks = block == Eigen::Vector3i::Ones() ? ct_hu : in_blocks(ct_hu, block);
  const Eigen::AlignedBox3d box = dense_box(blocks);
  if (box.isEmpty()) return {};
  const double edge = std::max(edge_mm, std::cbrt(box.volume() / max_voxels));
  const Eigen::Vector3i size = (box.sizes().array() / edge).ceil().cast<int>().max(1);
  Eigen::Affine3d lattice = Eigen::Affine3d::Identity();
  lattice.linear() *= edge;
  lattice.translation() = box.center() - 0.5 * edge * (size.array() - 1).cast<double>().matrix();
  Volume<float> result(size, lattice);
  const Eigen::Affine3d block_from_lattice = blocks.patient_from_voxel.inverse() * lattice;
  parallel_for(0, size.z(), [&](int k) {
    for (int j = 0; j < size.y(); ++j) {
      Eigen::Vector3d at = block_from_lattice * Eigen::Vector3d(0, j, k);
      for (int i = 0; i < size.x(); ++i, at += block_from_lattice.linear().col(0))
        result.at(i, j, k) = interpolated(blocks, at, kAirHu);
    }
  });
  return result;
}

}  // namespace isoshift
