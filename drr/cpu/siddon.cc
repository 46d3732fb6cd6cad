#include "drr/cpu/siddon.h"

#include <algorithm>

#include "drr/cpu/cell_walk.h"
#include "drr/of_beam.h"

namespace isoshift {
namespace {

double line_integral(const VoxelRay& ray, const Volume<float>& volume) {
  // Voxel i covers [i - 1/2, i + 1/2] around its center.
  VoxelRay cell_ray = ray;
  cell_ray.source.array() += 0.5;
  double sum = 0.0;
  walk_cells(cell_ray, volume.size, [&](const Eigen::Vector3i& cell, double begin, double end) {
    sum += volume.at(cell.x(), cell.y(), cell.z()) * (end - begin);
  });
  return sum * ray.length_mm;
}

}  // namespace

SiddonRenderer::SiddonRenderer(const Volume<float>& ct_hu, const AttenuationModel& model, std::span<const Beam> beams)
    : CpuRenderer(ct_hu.patient_from_voxel) {
  for (const Beam beam : beams) attenuation_per_mm_.emplace(beam, attenuation_volume(ct_hu, model, beam));
}

void SiddonRenderer::integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals,
                               std::span<RayGradient>) const {
  const Volume<float>& volume = of_beam(attenuation_per_mm_, beam);
  std::ranges::transform(rays, line_integrals.begin(),
                         [&](const VoxelRay& ray) { return static_cast<float>(line_integral(ray, volume)); });
}

}  // namespace isoshift
