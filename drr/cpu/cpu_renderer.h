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

VoxelRay ray_to(int column, int row, const Camera& camera, const Eigen::Matrix3d& mm_from_voxel_axes);

// How a line integral changes with the source and with the way of its ray, in voxels, if the length in mm stays.
struct RayGradient {
  Eigen::Vector3d by_source = Eigen::Vector3d::Zero();
  Eigen::Vector3d by_way = Eigen::Vector3d::Zero();
};

class CpuRenderer : public Renderer {
 public:
  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) final;
  RenderResult render_with_derivatives(std::span<const XrayView> views,
                                       std::span<const Eigen::Isometry3d> room_from_patient,
                                       const PixelSet& pixels) final;
  std::string device() const override;

 protected:
  explicit CpuRenderer(const Eigen::Affine3d& patient_from_voxel)
      : voxel_from_patient_(patient_from_voxel.inverse()), mm_from_voxel_axes_(patient_from_voxel.linear()) {}

  // Line integral of attenuation along each ray; called from many threads. Rays come in groups that lie close together.
  // `gradients` is empty if none are wanted, and always if the renderer has no derivatives.
  virtual void integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals,
                         std::span<RayGradient> gradients) const = 0;

 private:
  // A pixel of a view, and where its value goes among the view's.
  struct GroupPixel {
    int column, row;
    std::size_t place;
  };
  RenderResult render_all(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                          const PixelSet& pixels, bool with_derivatives) const;
  static std::vector<GroupPixel> pixels_of_tile(const XrayView& view, int tile);
  // `places`: those of the list that go together.
  static std::vector<GroupPixel> pixels_of_list(const XrayView& view, std::span<const std::uint32_t> pixels,
                                                std::span<const std::uint32_t> places);
  // `derivatives` is empty if none are wanted.
  void render_group(const XrayView& view, const Camera& camera, std::span<const GroupPixel> group, std::span<float> drr,
                    std::span<MotionDerivatives> derivatives) const;

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
