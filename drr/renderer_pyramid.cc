#include "drr/renderer_pyramid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "geometry/voxel_box.h"

namespace isoshift {
CoarserCt coarser_ct(const Volume<float>& ct_hu, const AttenuationModel& model, const Eigen::Vector3i& block) {
  const bool windowed = model.kind == AttenuationModel::Kind::kWindowed;
  const auto nothing_hu = static_cast<float>(windowed ? model.window_low_hu : -1000.0);
  const auto most_hu = windowed ? static_cast<float>(model.window_high_hu) : std::numeric_limits<float>::max();
  const auto attenuating_hu = [&](float hu) {
    return hu < static_cast<float>(model.threshold_hu) ? nothing_hu : std::clamp(hu, nothing_hu, most_hu);
  };

  // The last blocks may reach beyond the CT.
  const Eigen::Vector3i size = (ct_hu.size.array() + block.array() - 1) / block.array();
  CoarserCt coarser{.hu = Volume<float>(size, ct_hu.patient_from_voxel * voxel_from_block(block)), .model = model};
  coarser.model.threshold_hu = nothing_hu;
  parallel_for(0, size.z(), [&](int k) {
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        float sum = 0.0F;
        for (int z = 0; z < block.z(); ++z)
          for (int y = 0; y < block.y(); ++y)
            for (int x = 0; x < block.x(); ++x) {
              const Eigen::Vector3i at(i * block.x() + x, j * block.y() + y, k * block.z() + z);
              const bool inside = (at.array() < ct_hu.size.array()).all();
              sum += inside ? attenuating_hu(ct_hu.at(at.x(), at.y(), at.z())) : nothing_hu;
            }
        coarser.hu.at(i, j, k) = sum / static_cast<float>(block.prod());
      }
  });
  return coarser;
}

RendererPyramid::RendererPyramid(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                                 std::span<const Beam> beams, const RendererOptions& options)
    : voxel_mm_(std::cbrt(ct_hu.spacing_mm().prod())) {
  levels_.push_back(
      {.edge_mm = ct_hu.spacing_mm().maxCoeff(), .renderer = make_renderer(kind, ct_hu, model, beams, options)});
  Eigen::Vector3i last = Eigen::Vector3i::Ones();
  for (const double edge_mm : {1.0, 2.0, 4.0}) {
    const Eigen::Vector3i block = block_of(ct_hu.spacing_mm(), ct_hu.size, edge_mm);
    if (block == last) continue;
    last = block;
    const CoarserCt coarser = coarser_ct(ct_hu, model, block);
    levels_.push_back({.edge_mm = coarser.hu.spacing_mm().maxCoeff(),
                       .renderer = make_renderer(kind, coarser.hu, coarser.model, beams, options)});
  }
}

Renderer& RendererPyramid::with_voxels_up_to(double edge_mm) const {
  const auto fits = [&](const Level& level) { return level.edge_mm <= 1.01 * edge_mm; };
  const auto coarsest = std::find_if(levels_.rbegin(), levels_.rend(), fits);
  return coarsest == levels_.rend() ? finest() : *coarsest->renderer;
}

}  // namespace isoshift
