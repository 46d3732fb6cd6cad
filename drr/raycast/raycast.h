#pragma once
// Ray casting in an OpenGL compute shader (raycast.comp): any number of poses, views and pixels in one dispatch. What
// an optimization needs per step can stay on the GPU.

#include <map>
#include <vector>

#include "drr/gl/context.h"
#include "drr/gl/objects.h"
#include "drr/images_on_gpu.h"
#include "drr/raycast/attenuation_texture.h"
#include "drr/renderer.h"

namespace isoshift {

// How voxels are interpolated: by the texture units, or by shader code that rounds weights to 8 bits as the texture
// units of GPUs do, which llvmpipe does not. For tests.
enum class Filtering { kTextureUnits, kEightBitWeights };

class RaycastGlRenderer final : public Renderer, public ImagesOnGpu {
 public:
  // Throws Error where there is no OpenGL 4.5 of the kind asked for, or the volume exceeds its limits.
  RaycastGlRenderer(const Volume<float>& ct_hu, const AttenuationModel& model, std::span<const Beam> beams,
                    const RendererOptions& options, Filtering filtering = Filtering::kTextureUnits);
  ~RaycastGlRenderer() override { context_.try_make_current(); }

  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) override;
  RenderResult render_with_derivatives(std::span<const XrayView> views,
                                       std::span<const Eigen::Isometry3d> room_from_patient,
                                       const PixelSet& pixels) override;
  bool has_derivatives() const override { return true; }
  RendererKind kind() const override { return RendererKind::kRaycast; }
  std::string device() const override { return context_.renderer(); }
  std::optional<double> gpu_seconds() const override { return seconds_of(timer_, context_); }
  ImagesOnGpu* on_gpu() override { return this; }

  Buffer& render_on_gpu(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                        const PixelSet& pixels) override;
  WithDerivatives render_with_derivatives_on_gpu(std::span<const XrayView> views,
                                                 std::span<const Eigen::Isometry3d> room_from_patient,
                                                 const PixelSet& pixels) override;
  std::size_t poses_at_once(std::size_t pixels_per_pose, bool with_derivatives) const override;
  GlContext& context() const override { return context_; }

  void poison(std::size_t line_integrals) override;

 private:
  void upload_views(std::span<const XrayView> views, const std::vector<std::size_t>& begins, const PixelSet& pixels);
  RenderResult render_all(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                          const PixelSet& pixels, bool with_derivatives);
  void dispatch(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> poses, std::size_t pixels_per_pose,
                bool has_pixel_list, bool with_derivatives);
  void render_all_on_gpu(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                         const PixelSet& pixels, bool with_derivatives);

  GlContext& context_;
  const Program& program_;
  const Program* derivatives_program_ = nullptr;  // compiled when it is needed first
  Filtering filtering_;
  std::map<Beam, AttenuationTexture> attenuation_;
  std::optional<Texture3d> occupied_;
  Buffer cameras_, views_, pixels_, result_, rooms_, derivatives_;
  std::vector<std::uint32_t> uploaded_pixels_;  // a search renders the same ones again and again
  GlTimer timer_;
  Eigen::Affine3d voxel_from_patient_;
  double step_mm_;
  Eigen::Vector3d box_low_, box_high_;
  std::size_t rays_per_dispatch_;
};

}  // namespace isoshift
