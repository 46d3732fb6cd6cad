#pragma once
// Ray casting in an OpenGL compute shader (raycast.comp): any number of poses, views and pixels in one dispatch.

#include <map>
#include <vector>

#include "drr/gl/context.h"
#include "drr/gl/objects.h"
#include "drr/renderer.h"

namespace isoshift {

class RaycastGlRenderer final : public Renderer {
 public:
  // Throws Error where there is no OpenGL 4.5 of the kind asked for, or the volume exceeds its limits.
  RaycastGlRenderer(const Volume<float>& ct_hu, const AttenuationModel& model, std::span<const Beam> beams,
                    GlDevice device);

  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) override;
  RendererKind kind() const override { return RendererKind::kRaycast; }
  std::string device() const override { return context_.renderer(); }

 private:
  void upload_views(std::span<const XrayView> views, const std::vector<std::size_t>& begins, const PixelSet& pixels);
  void dispatch(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> poses, std::size_t pixels_per_pose,
                bool has_pixel_list, std::span<float> line_integrals);

  GlContext context_;  // first: what follows lives in it
  Program program_;
  std::map<Beam, Texture3d> attenuation_per_mm_;
  Buffer cameras_, views_, pixels_, result_;
  Eigen::Affine3d voxel_from_patient_;
  double step_mm_;
  Eigen::Vector3d box_low_, box_high_;
  std::vector<float> line_integrals_;
};

}  // namespace isoshift
