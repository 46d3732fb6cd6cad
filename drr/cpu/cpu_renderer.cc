#include "drr/cpu/cpu_renderer.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>

namespace isoshift {
namespace {

// One pose and view, ready to turn pixel indices into voxel rays.
struct Camera {
  Eigen::Vector3d source_voxel;
  Eigen::Matrix3d way_voxel_from_pixel;  // (column, row, 1) -> way from source to pixel
  Eigen::Matrix3d patient_from_voxel_axes;
  int columns;
  Beam beam;

  VoxelRay ray(std::uint32_t pixel) const {
    const Eigen::Vector3d way = way_voxel_from_pixel * Eigen::Vector3d(pixel % columns, pixel / columns, 1.0);
    return {.source = source_voxel, .way = way, .length_mm = (patient_from_voxel_axes * way).norm()};
  }
};

Camera make_camera(const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                   const Eigen::Affine3d& voxel_from_patient) {
  const Eigen::Isometry3d patient_from_room = room_from_patient.inverse();
  const Eigen::Matrix3d voxel_from_room_axes = voxel_from_patient.linear() * patient_from_room.linear();
  return {.source_voxel = voxel_from_patient * (patient_from_room * view.source_room_mm),
          .way_voxel_from_pixel = voxel_from_room_axes * view.pixel_from_room.leftCols<3>().inverse(),
          .patient_from_voxel_axes = voxel_from_patient.linear().inverse(),
          .columns = view.columns,
          .beam = view.beam};
}

}  // namespace

std::string CpuRenderer::device() const {
  return fmt::format("CPU, {} threads", tbb::this_task_arena::max_concurrency());
}

RenderResult CpuRenderer::render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                                 const PixelSet& pixels) {
  std::vector<std::size_t> view_begins = {0};
  for (std::size_t v = 0; v < views.size(); ++v) view_begins.push_back(view_begins.back() + pixels.count(views, v));
  line_integrals_.resize(view_begins.back() * room_from_patient.size());

  for (std::size_t p = 0; p < room_from_patient.size(); ++p) {
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Camera camera = make_camera(views[v], room_from_patient[p], voxel_from_patient_);
      const std::uint32_t* list = pixels.of_view.empty() ? nullptr : pixels.of_view[v].data();
      float* drr = line_integrals_.data() + p * view_begins.back() + view_begins[v];
      const std::size_t count = view_begins[v + 1] - view_begins[v];
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 256), [&](const auto& range) {
        for (std::size_t n = range.begin(); n != range.end(); ++n) {
          const auto pixel = list ? list[n] : static_cast<std::uint32_t>(n);
          drr[n] = static_cast<float>(integrate(camera.ray(pixel), camera.beam));
        }
      });
    }
  }
  return RenderResult(line_integrals_, std::move(view_begins));
}

std::optional<RaySegment> clip_to_box(const VoxelRay& ray, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
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
