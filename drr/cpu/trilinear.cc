#include "drr/cpu/trilinear.h"

#include <algorithm>

#include "drr/cpu/cell_walk.h"

namespace isoshift {
namespace {

double voxel_or_zero(const Volume<float>& volume, int i, int j, int k) {
  const bool inside = i >= 0 && j >= 0 && k >= 0 && i < volume.size.x() && j < volume.size.y() && k < volume.size.z();
  return inside ? volume.at(i, j, k) : 0.0;
}

// Trilinear value at `fraction` of the way from voxel `corner` to the next one along each axis.
double interpolate(const Volume<float>& volume, const Eigen::Vector3i& corner, const Eigen::Vector3d& fraction) {
  double value = 0.0;
  for (int n = 0; n < 8; ++n) {
    const Eigen::Vector3i offset(n & 1, (n >> 1) & 1, n >> 2);
    const Eigen::Vector3d distance = (fraction - offset.cast<double>()).cwiseAbs();
    const Eigen::Vector3i voxel = corner + offset;
    value += (1.0 - distance.array()).prod() * voxel_or_zero(volume, voxel.x(), voxel.y(), voxel.z());
  }
  return value;
}

double line_integral(const VoxelRay& ray, const Volume<float>& volume) {
  constexpr double kGaussOffset = 0.28867513459481287;  // 1 / (2 sqrt 3)
  // Cells lie between voxel centers, one more on each side for the way down to zero: cell c spans voxels c-1 and c.
  VoxelRay cell_ray = ray;
  cell_ray.source.array() += 1.0;
  const Eigen::Vector3i cells = volume.size.array() + 1;
  double sum = 0.0;
  walk_cells(cell_ray, cells, [&](const Eigen::Vector3i& cell, double begin, double end) {
    const double middle = 0.5 * (begin + end);
    const double offset = kGaussOffset * (end - begin);
    double values = 0.0;
    for (const double t : {middle - offset, middle + offset}) {
      const Eigen::Vector3d fraction = cell_ray.source + t * cell_ray.way - cell.cast<double>();
      values += interpolate(volume, cell.array() - 1, fraction);
    }
    sum += 0.5 * values * (end - begin);
  });
  return sum * ray.length_mm;
}

}  // namespace

TrilinearRenderer::TrilinearRenderer(const Volume<float>& ct_hu, const AttenuationModel& model,
                                     std::span<const Beam> beams)
    : CpuRenderer(ct_hu) {
  for (const Beam beam : beams) attenuation_per_mm_.emplace(beam, attenuation_volume(ct_hu, model, beam));
}

void TrilinearRenderer::integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals) const {
  const Volume<float>& volume = attenuation_per_mm_.at(beam);
  std::ranges::transform(rays, line_integrals.begin(),
                         [&](const VoxelRay& ray) { return static_cast<float>(line_integral(ray, volume)); });
}

}  // namespace isoshift
