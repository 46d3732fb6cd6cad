#pragma once
// Trilinear ray casting in single precision at a fixed step: what renders where there is no GPU.

#include <map>

#include "drr/cpu/cpu_renderer.h"

namespace isoshift {

class RaycastCpuRenderer final : public CpuRenderer {
 public:
  RaycastCpuRenderer(const Volume<float>& ct_hu, const AttenuationModel& model, std::span<const Beam> beams);
  RendererKind kind() const override { return RendererKind::kCpu; }

 private:
  // Attenuation with a border of zeros, one voxel below and two above, so that no sample needs a bounds check, not even
  // one exactly on the upper face.
  struct PaddedVolume {
    Volume<float> attenuation_per_mm;
    OccupiedBox box;  // in padded voxel indices
  };
  static PaddedVolume pad(const Volume<float>& ct_hu, const AttenuationModel& model, Beam beam);

  double integrate(const VoxelRay& ray, Beam beam) const override;

  std::map<Beam, PaddedVolume> volumes_;
  double step_mm_;
};

}  // namespace isoshift
