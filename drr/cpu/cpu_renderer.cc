#include "drr/cpu/cpu_renderer.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "drr/camera.h"

namespace isoshift {
namespace {

constexpr int kTileEdge = 16;  // neighboring rays read the same voxels: a tile of them stays in the cache
constexpr int kGroup = kTileEdge * kTileEdge;

VoxelRay ray_to(int column, int row, const Camera& camera, const Eigen::Matrix3d& mm_from_voxel_axes) {
  const Eigen::Vector3d way = camera.way_voxel_from_pixel * Eigen::Vector3d(column, row, 1.0);
  return {.source = camera.source_voxel, .way = way, .length_mm = (mm_from_voxel_axes * way).norm()};
}

// Pixel n of a tile, relative to its first: blocks of 4 x 4 one after the other, because rays that follow each other
// are taken together.
struct PixelInTile {
  int column, row;
};
constexpr int kBlockEdge = 4;
constexpr int kBlockPixels = kBlockEdge * kBlockEdge;
PixelInTile pixel_in_tile(int n) {
  constexpr int kBlocks = kTileEdge / kBlockEdge;
  const int block = n / kBlockPixels, rest = n % kBlockPixels;
  return {block % kBlocks * kBlockEdge + rest % kBlockEdge, block / kBlocks * kBlockEdge + rest / kBlockEdge};
}

int tiles_along(int pixels) { return (pixels + kTileEdge - 1) / kTileEdge; }

// The places in a list of pixels, ordered so that rays which follow each other lie close together: by bands of rows, so
// high that kBlockPixels neighbors fill a square, and in a band by column. Sorted by counting.
std::vector<std::uint32_t> neighbors_together(std::span<const std::uint32_t> pixels, const XrayView& view) {
  if (pixels.empty()) return {};
  const double pixels_per_ray = static_cast<double>(view.columns) * view.rows / static_cast<double>(pixels.size());
  const int band = std::max(1, static_cast<int>(std::lround(std::sqrt(kBlockPixels * pixels_per_ray))));
  const auto bucket_of = [&](std::uint32_t pixel) {
    const int column = static_cast<int>(pixel) % view.columns, row = static_cast<int>(pixel) / view.columns;
    return static_cast<std::size_t>(row / band) * view.columns + column;
  };
  std::vector<std::uint32_t> begins(static_cast<std::size_t>(view.rows / band + 1) * view.columns + 1);
  for (const std::uint32_t pixel : pixels) ++begins[bucket_of(pixel) + 1];
  std::partial_sum(begins.begin(), begins.end(), begins.begin());
  std::vector<std::uint32_t> places(pixels.size());
  for (std::uint32_t place = 0; place < pixels.size(); ++place) places[begins[bucket_of(pixels[place])]++] = place;
  return places;
}

}  // namespace

std::string CpuRenderer::device() const {
  return fmt::format("CPU, {} threads", tbb::this_task_arena::max_concurrency());
}

RenderResult CpuRenderer::render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                                 const PixelSet& pixels) {
  std::vector<std::size_t> begins = checked_view_begins(views, room_from_patient, pixels);
  line_integrals_.resize(begins.back() * room_from_patient.size());

  std::vector<std::vector<std::uint32_t>> orders;
  for (std::size_t v = 0; v < pixels.of_view.size(); ++v)
    orders.push_back(neighbors_together(pixels.of_view[v], views[v]));
  for (std::size_t p = 0; p < room_from_patient.size(); ++p)
    for (std::size_t v = 0; v < views.size(); ++v) {
      const Camera camera = make_camera(views[v], room_from_patient[p], voxel_from_patient_);
      const auto drr = std::span(line_integrals_).subspan(p * begins.back() + begins[v], begins[v + 1] - begins[v]);
      if (pixels.of_view.empty())
        render_all(views[v], camera, drr);
      else
        render_list(views[v], camera, pixels.of_view[v], orders[v], drr);
    }
  return RenderResult(line_integrals_, std::move(begins));
}

void CpuRenderer::render_all(const XrayView& view, const Camera& camera, std::span<float> drr) const {
  const int tiles_per_row = tiles_along(view.columns);
  tbb::parallel_for(0, tiles_per_row * tiles_along(view.rows), [&](int tile) {
    const int first_column = tile % tiles_per_row * kTileEdge, first_row = tile / tiles_per_row * kTileEdge;
    std::array<VoxelRay, kGroup> rays;
    std::array<float, kGroup> values;
    for (int n = 0; n < kGroup; ++n) {
      const PixelInTile pixel = pixel_in_tile(n);
      rays[n] = ray_to(first_column + pixel.column, first_row + pixel.row, camera, mm_from_voxel_axes_);
    }
    integrate(rays, view.beam, values);
    for (int n = 0; n < kGroup; ++n) {
      const auto [column, row] = pixel_in_tile(n);  // the last tiles reach beyond the image
      if (first_column + column < view.columns && first_row + row < view.rows)
        drr[static_cast<std::size_t>(first_row + row) * view.columns + first_column + column] = values[n];
    }
  });
}

void CpuRenderer::render_list(const XrayView& view, const Camera& camera, std::span<const std::uint32_t> pixels,
                              std::span<const std::uint32_t> places, std::span<float> drr) const {
  // Groups of fixed size: which rays go together must not depend on how the work is spread, or rounding would.
  constexpr int kListGroup = 4 * kBlockPixels;
  const int groups = (static_cast<int>(places.size()) + kListGroup - 1) / kListGroup;
  tbb::parallel_for(0, groups, [&](int group) {
    const auto in_group = places.subspan(static_cast<std::size_t>(group) * kListGroup);
    const std::size_t count = std::min<std::size_t>(kListGroup, in_group.size());
    std::array<VoxelRay, kListGroup> rays;
    std::array<float, kListGroup> values;
    for (std::size_t n = 0; n < count; ++n) {
      const int pixel = static_cast<int>(pixels[in_group[n]]);
      rays[n] = ray_to(pixel % view.columns, pixel / view.columns, camera, mm_from_voxel_axes_);
    }
    integrate(std::span(rays).first(count), view.beam, std::span(values).first(count));
    for (std::size_t n = 0; n < count; ++n) drr[in_group[n]] = values[n];
  });
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
