#pragma once
// Wobbled splatting (Birkfellner et al. 2005; Spoerk et al. 2012, 2.1) in the three variants of the founding paper:
// voxels sent to OpenGL for every image, the same with random numbers from a small texture, and voxels kept in vertex
// buffers. Only voxels above the threshold are ever uploaded.

#include <map>
#include <vector>

#include "drr/gl/context.h"
#include "drr/gl/objects.h"
#include "drr/quantized_volume.h"
#include "drr/renderer.h"

namespace isoshift {

class SplatRenderer final : public Renderer {
 public:
  // `kind` is one of the three splatting kinds. Throws Error
  // where there is no OpenGL 4.5 of the kind asked for, or the volume has 2^32 voxels or more.
  SplatRenderer(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                std::span<const Beam> beams, const RendererOptions& options);
  ~SplatRenderer() override { context_.try_make_current(); }

  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) override;
  RendererKind kind() const override { return kind_; }
  std::string device() const override { return context_.renderer(); }
  std::optional<double> gpu_seconds() const override { return seconds_of(timer_, context_); }

 private:
  // The voxels above the threshold, as they are sent.
  struct Voxels {
    std::vector<std::uint32_t> index;
    QuantizedVolume::Voxels attenuation;
    double unit_per_mm = 1.0;  // of a vertex attribute of 1
    Buffer index_buffer, attenuation_buffer;
    VertexArray vertices;

    void upload();
  };

  void draw(const XrayView& view, const Eigen::Isometry3d& room_from_patient);

  GlContext& context_;
  RendererKind kind_;
  const Program& program_;
  std::map<Beam, Voxels> voxels_;
  std::optional<Texture3d> noise_;
  RenderTarget image_;
  GlTimer timer_;
  SplatOptions options_;
  Eigen::Affine3d patient_from_voxel_, voxel_from_patient_;
  Eigen::Vector3i size_;
  std::vector<float> whole_image_;
};

}  // namespace isoshift
