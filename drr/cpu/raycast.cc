#include "drr/cpu/raycast.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace isoshift {
namespace {

// Trilinear value at a position at least half a voxel inside the lattice.
inline float sample(const float* voxels, std::ptrdiff_t row, std::ptrdiff_t slice, float x, float y, float z) {
  const int i = static_cast<int>(x);
  const int j = static_cast<int>(y);
  const int k = static_cast<int>(z);
  const float fx = x - static_cast<float>(i);
  const float fy = y - static_cast<float>(j);
  const float fz = z - static_cast<float>(k);
  const float* v = voxels + k * slice + j * row + i;
  const float* w = v + slice;
  const float v0 = v[0] + fx * (v[1] - v[0]);
  const float v1 = v[row] + fx * (v[row + 1] - v[row]);
  const float w0 = w[0] + fx * (w[1] - w[0]);
  const float w1 = w[row] + fx * (w[row + 1] - w[row]);
  const float near = v0 + fy * (v1 - v0);
  const float far = w0 + fy * (w1 - w0);
  return near + fz * (far - near);
}

}  // namespace

RaycastCpuRenderer::RaycastCpuRenderer(const Volume<float>& ct_hu, const AttenuationModel& model,
                                       std::span<const Beam> beams)
    : CpuRenderer(ct_hu), step_mm_(ct_hu.spacing_mm().minCoeff()) {
  for (const Beam beam : beams) volumes_.emplace(beam, pad(ct_hu, model, beam));
}

RaycastCpuRenderer::PaddedVolume RaycastCpuRenderer::pad(const Volume<float>& ct_hu, const AttenuationModel& model,
                                                         Beam beam) {
  const Eigen::Vector3i size = ct_hu.size;
  Volume<float> padded(size.array() + 3, ct_hu.patient_from_voxel);
  tbb::parallel_for(0, size.z(), [&](int k) {
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i)
        padded.at(i + 1, j + 1, k + 1) = model.attenuation_per_mm(ct_hu.at(i, j, k), beam);
  });
  const OccupiedBox box = occupied_box(padded);
  return {.attenuation_per_mm = std::move(padded), .box = box};
}

double RaycastCpuRenderer::integrate(const VoxelRay& ray, Beam beam) const {
  const PaddedVolume& volume = volumes_.at(beam);
  VoxelRay padded_ray = ray;
  padded_ray.source.array() += 1.0;
  const auto segment = clip_to_box(padded_ray, volume.box.low, volume.box.high);
  if (!segment) return 0.0;

  // Midpoint rule: whole steps of at most one voxel fill the segment exactly.
  const double segment_mm = (segment->end - segment->begin) * ray.length_mm;
  const int steps = std::max(1, static_cast<int>(std::ceil(segment_mm / step_mm_)));
  const double step_t = (segment->end - segment->begin) / steps;
  const Eigen::Vector3f step = (step_t * padded_ray.way).cast<float>();
  const Eigen::Vector3d middle = padded_ray.source + (segment->begin + 0.5 * step_t) * padded_ray.way;
  const Eigen::Vector3f first = middle.cast<float>();

  const Volume<float>& lattice = volume.attenuation_per_mm;
  const std::ptrdiff_t row = lattice.size.x();
  const std::ptrdiff_t slice = row * lattice.size.y();
  float sum = 0.0F;
  for (int n = 0; n < steps; ++n) {
    const auto steps_done = static_cast<float>(n);
    sum += sample(lattice.voxels.data(), row, slice, first.x() + steps_done * step.x(),
                  first.y() + steps_done * step.y(), first.z() + steps_done * step.z());
  }
  return sum * step_t * ray.length_mm;
}

}  // namespace isoshift
