#pragma once
// Renderers of one CT at several resolutions: coarse stages of a search read coarse voxels, which is faster, and closer
// to what a block of detector pixels sees than thin rays through fine voxels.

#include <memory>
#include <vector>

#include "drr/renderer.h"

namespace isoshift {

// A CT of blocks of voxels, averaged, and the model that turns it into attenuation. What is below the threshold counts
// as nothing before it is averaged.
struct CoarserCt {
  Volume<float> hu;
  AttenuationModel model;
};
CoarserCt coarser_ct(const Volume<float>& ct_hu, const AttenuationModel& model, const Eigen::Vector3i& block);

class RendererPyramid {
 public:
  // Makes renderers as make_renderer() does: one for the CT itself, and one each for voxels of about 1, 2 and 4 mm if
  // the CT's voxels are finer.
  RendererPyramid(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                  std::span<const Beam> beams, const RendererOptions& options = {});

  // Of the CT itself.
  Renderer& finest() const { return *levels_.front().renderer; }

  // The coarsest renderer whose voxels have edges of at most `edge_mm`; if there is none, the finest.
  Renderer& with_voxels_up_to(double edge_mm) const;

  // Edge of a cube as large as a voxel of the CT.
  double voxel_mm() const { return voxel_mm_; }

 private:
  struct Level {
    double edge_mm;  // the longest
    std::unique_ptr<Renderer> renderer;
  };
  std::vector<Level> levels_;  // finest first
  double voxel_mm_;
};

}  // namespace isoshift
