#pragma once
// The oracle of constant voxels: exact line integrals through boxes of constant attenuation (Siddon 1985), in double.

#include <map>

#include "drr/cpu/cpu_renderer.h"

namespace isoshift {

class SiddonRenderer final : public CpuRenderer {
 public:
  SiddonRenderer(const Volume<float>& ct_hu, const AttenuationModel& model, std::span<const Beam> beams);
  RendererKind kind() const override { return RendererKind::kSiddon; }

 private:
  void integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals,
                 std::span<RayGradient> gradients) const override;

  std::map<Beam, Volume<float>> attenuation_per_mm_;
};

}  // namespace isoshift
