#pragma once
// Ray casting as in the founding paper (Spoerk et al. 2012, 2.2): the rasterizer draws the back and the front faces of
// a bounding structure with positions as colors, and rays run between them. The structure is the volume's box, or a
// cuberille: the surface of all blocks that hold anything above the threshold.

#include <map>
#include <vector>

#include "drr/gl/context.h"
#include "drr/gl/objects.h"
#include "drr/raycast/attenuation_texture.h"
#include "drr/renderer.h"
#include "geometry/image.h"

namespace isoshift {

class RasterizedRaycaster final : public Renderer {
 public:
  // `kind` is kRaycastBox or kRaycastCuberille. Throws Error
  // where there is no OpenGL 4.5 of the kind asked for, or the volume exceeds its limits.
  RasterizedRaycaster(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                      std::span<const Beam> beams, const RendererOptions& options);
  ~RasterizedRaycaster() override { context_.try_make_current(); }

  RenderResult render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                      const PixelSet& pixels) override;
  RendererKind kind() const override { return kind_; }
  std::string device() const override { return context_.renderer(); }
  std::optional<double> gpu_seconds() const override { return seconds_of(timer_, context_); }

  // The front faces as colors: position in the volume from 0 to 1 along each axis (Fig. 1 of the paper). Background:
  // NaN.
  Image<std::array<float, 3>> front_positions(const XrayView& view, const Eigen::Isometry3d& room_from_patient);

 private:
  struct Structure {
    Buffer faces;
    VertexArray vertices;
    int face_count = 0;
  };

  void draw_faces(const XrayView& view, const Eigen::Isometry3d& room_from_patient, bool front);
  void draw_line_integrals(const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                           std::span<const std::uint32_t> pixel_list, std::size_t count);

  GlContext& context_;
  RendererKind kind_;
  const Program &faces_program_, &integral_program_;
  std::map<Beam, AttenuationTexture> attenuation_;
  std::map<Beam, Structure> structures_;
  RenderTarget front_, back_, result_;
  Buffer pixels_;
  GlTimer timer_;
  Eigen::Affine3d patient_from_voxel_, voxel_from_patient_;
  Eigen::Vector3i size_;
  Eigen::Vector3d block_edge_;  // voxels
  double step_mm_;
};

}  // namespace isoshift
