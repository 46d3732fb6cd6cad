#pragma once
// The oracle of trilinear interpolation: exact line integrals, in double. Between eight neighboring voxel centers the
// interpolated value along a straight line is a cubic polynomial, which two Gauss-Legendre points integrate exactly: no
// step size, no step error. Outside the outermost voxel centers the value falls linearly to 0 one voxel further out, as
// a texture with a border of zeros does, so that the volume's total attenuation equals that of the Siddon oracle.

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "drr/cpu/cpu_renderer.h"

namespace isoshift {

class TrilinearRenderer final : public CpuRenderer {
 public:
  TrilinearRenderer(const Volume<float>& ct_hu, const AttenuationModel& model, std::span<const Beam> beams);
  explicit TrilinearRenderer(AttenuationByBeam attenuation_per_mm);
  RendererKind kind() const override { return RendererKind::kTrilinear; }
  bool has_derivatives() const override { return true; }

 private:
  void integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals,
                 std::span<RayGradient> gradients) const override;

  AttenuationByBeam attenuation_per_mm_;
};

// The line integrals of listed pixels (row * columns + column), as this renderer's but without a copy of the CT: for a
// few rays of it.
std::vector<double> exact_line_integrals(const Volume<float>& ct_hu, const AttenuationModel& model,
                                         const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                                         std::span<const std::uint32_t> pixels);

}  // namespace isoshift
