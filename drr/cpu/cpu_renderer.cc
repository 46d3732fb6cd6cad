#include "drr/cpu/cpu_renderer.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

#include "drr/camera.h"

namespace isoshift {
namespace {

VoxelRay ray_to(std::uint32_t pixel, int columns, const Camera& camera, const Eigen::Matrix3d& mm_from_voxel_axes) {
  const int column = static_cast<int>(pixel) % columns, row = static_cast<int>(pixel) / columns;
  const Eigen::Vector3d way = camera.way_voxel_from_pixel * Eigen::Vector3d(column, row, 1.0);
  return {.source = camera.source_voxel, .way = way, .length_mm = (mm_from_voxel_axes * way).norm()};
}

}  // namespace

std::string CpuRenderer::device() const {
  return fmt::format("CPU, {} threads", tbb::this_task_arena::max_concurrency());
}

RenderResult CpuRenderer::render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                                 const PixelSet& pixels) {
  std::vector<std::size_t> begins = view_begins(views, pixels);
  line_integrals_.resize(begins.back() * room_from_patient.size());
  const Eigen::Matrix3d mm_from_voxel_axes = voxel_from_patient_.linear().inverse();

  for (std::size_t p = 0; p < room_from_patient.size(); ++p) {
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Camera camera = make_camera(views[v], room_from_patient[p], voxel_from_patient_);
      const std::uint32_t* list = pixels.of_view.empty() ? nullptr : pixels.of_view[v].data();
      float* drr = line_integrals_.data() + p * begins.back() + begins[v];
      const std::size_t count = begins[v + 1] - begins[v];
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 256), [&](const auto& range) {
        for (std::size_t n = range.begin(); n != range.end(); ++n) {
          const auto pixel = list ? list[n] : static_cast<std::uint32_t>(n);
          drr[n] =
              static_cast<float>(integrate(ray_to(pixel, views[v].columns, camera, mm_from_voxel_axes), views[v].beam));
        }
      });
    }
  }
  return RenderResult(line_integrals_, std::move(begins));
}

std::optional<RaySegment> clip_to_box(const VoxelRay& ray, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  if (!ray.source.allFinite() || !ray.way.allFinite()) return std::nullopt;
  RaySegment segment{.begin = 0.0, .end = 1.0};
  for (int axis = 0; axis < 3; ++axis) {
    if (ray.way[axis] == 0.0) {
      if (ray.source[axis] < low[axis] || ray.source[axis] > high[axis]) return std::nullopt;
      continue;
    }
    const double at_low = (low[axis] - ray.source[axis]) / ray.way[axis];
    const double at_high = (high[axis] - ray.source[axis]) / ray.way[axis];
    segment.begin = std::max(segment.begin, std::min(at_low, at_high));
    segment.end = std::min(segment.end, std::max(at_low, at_high));
  }
  if (!(segment.begin < segment.end)) return std::nullopt;
  return segment;
}

}  // namespace isoshift
