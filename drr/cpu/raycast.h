#pragma once
// Ray casting in single precision on all cores: what renders where there is no GPU. Packets of neighboring rays march
// from voxel plane to voxel plane (march.h).

#include <map>

#include "drr/cpu/cpu_renderer.h"
#include "drr/cpu/march.h"
#include "drr/occupied_blocks.h"
#include "drr/quantized_volume.h"

namespace isoshift {

class RaycastCpuRenderer final : public CpuRenderer {
 public:
  RaycastCpuRenderer(const Volume<float>& ct_hu, const AttenuationModel& model, std::span<const Beam> beams,
                     const RendererOptions& options);
  RaycastCpuRenderer(const AttenuationByBeam& attenuation_per_mm, const RendererOptions& options);
  RendererKind kind() const override { return RendererKind::kCpu; }
  bool has_derivatives() const override { return true; }
  std::string device() const override;

 private:
  // The occupied voxels with a border of zeros, one voxel below and two above, so that no sample needs a bounds check,
  // not even one exactly on the upper face. Kept twice: a row's voxels must be neighbors in a plane across the main
  // axis.
  struct PackedVolume {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // in voxels of the CT
    Eigen::Vector3i size = Eigen::Vector3i::Zero();    // border included; 0 for a volume of nothing
    double unit_per_mm = 1.0;
    QuantizedVolume::Voxels x_fastest;  // [z][y][x], for main axes y and z
    QuantizedVolume::Voxels y_fastest;  // [z][x][y], for main axis x
    BlockGrid blocks;                   // of kSkipEdge voxels, border included

    template <class T>
    PlaneLattice<T> lattice(int main_axis) const;
  };
  static PackedVolume pack(QuantizedVolume attenuation);

  void integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals,
                 std::span<RayGradient> gradients) const override;

  std::map<Beam, PackedVolume> volumes_;
};

}  // namespace isoshift
