#pragma once
// What all renderers on the CPU share: poses, views and pixels become rays in voxel coordinates, spread over the cores.

#include <optional>
#include <vector>

#include "drr/camera.h"
#include "drr/renderer.h"

namespace isoshift {

// A ray in continuous voxel indices; the length of the whole way is kept in mm.
struct VoxelRay {
  Eigen::Vector3d source;  // at t = 0
  Eigen::Vector3d way;     // source + way is the pixel, at t = 1
  double length_mm = 0.0;
};

class CpuRenderer : public Renderer {
 public:
  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) final;
  std::string device() const override;

 protected:
  explicit CpuRenderer(const Volume<float>& ct_hu)
      : voxel_from_patient_(ct_hu.patient_from_voxel.inverse()),
        mm_from_voxel_axes_(ct_hu.patient_from_voxel.linear()) {}

  // Line integral of attenuation along each ray; called from many threads. Rays come in groups that lie close together.
  virtual void integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals) const = 0;

 private:
  void render_tile(const XrayView& view, const Camera& camera, int tile, std::span<float> drr) const;
  // `places`: those of the list that go together.
  void render_group(const XrayView& view, const Camera& camera, std::span<const std::uint32_t> pixels,
                    std::span<const std::uint32_t> places, std::span<float> drr) const;

  Eigen::Affine3d voxel_from_patient_;
  Eigen::Matrix3d mm_from_voxel_axes_;
};

// The part of a ray inside an axis-aligned box, as an interval of t within [0, 1]; nothing where it misses.
struct RaySegment {
  double begin;
  double end;
};
std::optional<RaySegment> clip_to_box(const VoxelRay& ray, const Eigen::Vector3d& low, const Eigen::Vector3d& high);

}  // namespace isoshift
