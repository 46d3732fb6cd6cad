#include "drr/renderer_pyramid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

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
    std::vector<float> row(static_cast<std::size_t>(size.x()) * block.x(), nothing_hu);
    for (int j = 0; j < size.y(); ++j) {
      float* sums = &coarser.hu.at(0, j, k);
      for (int z = k * block.z(); z < (k + 1) * block.z(); ++z)
        for (int y = j * block.y(); y < (j + 1) * block.y(); ++y) {
          if (z < ct_hu.size.z() && y < ct_hu.size.y())
            std::transform(&ct_hu.at(0, y, z), &ct_hu.at(0, y, z) + ct_hu.size.x(), row.begin(), attenuating_hu);
          else
            std::ranges::fill(row, nothing_hu);
          for (int i = 0; i < size.x(); ++i)
            for (int x = 0; x < block.x(); ++x) sums[i] += row[static_cast<std::size_t>(i) * block.x() + x];
        }
      for (int i = 0; i < size.x(); ++i) sums[i] /= static_cast<float>(block.prod());
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
  std::optional<CoarserCt> coarser;
  for (const double edge_mm : {1.0, 2.0, 4.0}) {
    const Eigen::Vector3i block = block_of(ct_hu.spacing_mm(), ct_hu.size, edge_mm);
    if (block == last) continue;
    // Blocks of whole blocks have the mean of their means.
    const Eigen::Vector3i of_last = block.cwiseQuotient(last);
    if (coarser && of_last.cwiseProduct(last) == block)
      coarser = coarser_ct(coarser->hu, coarser->model, of_last);
    else
      coarser = coarser_ct(ct_hu, model, block);
    last = block;
    levels_.push_back({.edge_mm = coarser->hu.spacing_mm().maxCoeff(),
                       .renderer = make_renderer(kind, coarser->hu, coarser->model, beams, options)});
  }
}

Renderer& RendererPyramid::with_voxels_up_to(double edge_mm) const {
  const auto fits = [&](const Level& level) { return level.edge_mm <= 1.01 * edge_mm; };
  const auto coarsest = std::find_if(levels_.rbegin(), levels_.rend(), fits);
  return coarsest == levels_.rend() ? finest() : *coarsest->renderer;
}

}  // namespace isoshift
