#include "drr/cpu/cpu_renderer.h"

#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/parallel.h"
#include "drr/camera.h"

namespace isoshift {
namespace {

constexpr int kTileEdge = 16;  // neighboring rays read the same voxels: a tile of them stays in the cache
constexpr int kGroup = kTileEdge * kTileEdge;

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

// Groups of fixed size: which rays go together must not depend on how the work is spread, or rounding would.
constexpr std::size_t kListGroup = 4 * kBlockPixels;
int groups_of(std::size_t pixels) { return static_cast<int>((pixels + kListGroup - 1) / kListGroup); }
std::span<const std::uint32_t> group_of(std::span<const std::uint32_t> places, int group) {
  const auto from_group = places.subspan(static_cast<std::size_t>(group) * kListGroup);
  return from_group.first(std::min(kListGroup, from_group.size()));
}

constexpr std::size_t kNowhere = std::numeric_limits<std::size_t>::max();  // the place of a pixel that is not rendered

// The chain rule. If the patient moves by theta = (t, w), a point x of the room meets the voxel that was at
// x - t - w x x: the source and the way, S and W in the room, move by -A (t + w x S) and -A (w x W) in voxels.
MotionDerivatives motion_derivatives(const RayGradient& gradient, int column, int row, const Camera& camera) {
  const Eigen::Vector3d by_source = camera.voxel_from_room_axes.transpose() * gradient.by_source;
  const Eigen::Vector3d by_way = camera.voxel_from_room_axes.transpose() * gradient.by_way;
  const Eigen::Vector3d way = camera.way_room_from_pixel * Eigen::Vector3d(column, row, 1.0);
  MotionDerivatives derivatives;
  derivatives.head<3>() = -by_source.cast<float>();
  const Eigen::Vector3d source = camera.source_room_mm + row * camera.row_step_room_mm;
  derivatives.tail<3>() = -(source.cross(by_source) + way.cross(by_way)).cast<float>();
  return derivatives;
}

}  // namespace

VoxelRay ray_to(int column, int row, const Camera& camera, const Eigen::Matrix3d& mm_from_voxel_axes) {
  // Lazy products: GCC 12 calls a function for each of the others, which took 5 % of a registration of bodies.
  const Eigen::Vector3d way = camera.way_voxel_from_pixel.lazyProduct(Eigen::Vector3d(column, row, 1.0));
  return {.source = camera.source_voxel + row * camera.row_step_voxel,
          .way = way,
          .length_mm = mm_from_voxel_axes.lazyProduct(way).norm()};
}

std::string CpuRenderer::device() const {
  return fmt::format("CPU, {} threads", tbb::this_task_arena::max_concurrency());
}

RenderResult CpuRenderer::render(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                                 const PixelSet& pixels) {
  return render_all(views, room_from_patient, pixels, false);
}

RenderResult CpuRenderer::render_with_derivatives(std::span<const XrayView> views,
                                                  std::span<const Eigen::Isometry3d> room_from_patient,
                                                  const PixelSet& pixels) {
  if (!has_derivatives()) return Renderer::render_with_derivatives(views, room_from_patient, pixels);
  return render_all(views, room_from_patient, pixels, true);
}

RenderResult CpuRenderer::render_all(std::span<const XrayView> views,
                                     std::span<const Eigen::Isometry3d> room_from_patient, const PixelSet& pixels,
                                     bool with_derivatives) const {
  std::vector<std::size_t> begins = checked_view_begins(views, room_from_patient, pixels);
  std::vector<float> line_integrals(begins.back() * room_from_patient.size());
  std::vector<MotionDerivatives> derivatives(with_derivatives ? line_integrals.size() : 0);
  const bool all = pixels.of_view.empty();

  // The work of one pose: tiles or groups of every view, one after the other.
  std::vector<int> group_begins = {0};
  std::vector<std::vector<std::uint32_t>> orders;
  for (std::size_t v = 0; v < views.size(); ++v) {
    if (!all) orders.push_back(neighbors_together(pixels.of_view[v], views[v]));
    group_begins.push_back(group_begins.back() + (all ? tiles_along(views[v].columns) * tiles_along(views[v].rows)
                                                      : groups_of(orders[v].size())));
  }
  std::vector<Camera> cameras;
  for (const Eigen::Isometry3d& pose : room_from_patient)
    for (const XrayView& view : views) cameras.push_back(make_camera(view, pose, voxel_from_patient_));

  const auto poses = static_cast<int>(room_from_patient.size());
  parallel_for(0, poses * group_begins.back(), [&](int work) {
    const std::size_t p = work / group_begins.back();
    const int in_pose = work % group_begins.back();
    const std::size_t v = std::ranges::upper_bound(group_begins, in_pose) - group_begins.begin() - 1;
    const int group = in_pose - group_begins[v];
    const std::size_t begin = p * begins.back() + begins[v], count = begins[v + 1] - begins[v];
    render_group(
        views[v], cameras[p * views.size() + v],
        all ? pixels_of_tile(views[v], group) : pixels_of_list(views[v], pixels.of_view[v], group_of(orders[v], group)),
        std::span(line_integrals).subspan(begin, count),
        with_derivatives ? std::span(derivatives).subspan(begin, count) : std::span<MotionDerivatives>());
  });
  return RenderResult(std::move(line_integrals), std::move(begins), std::move(derivatives));
}

std::vector<CpuRenderer::GroupPixel> CpuRenderer::pixels_of_tile(const XrayView& view, int tile) {
  const int tiles_per_row = tiles_along(view.columns);
  const int first_column = tile % tiles_per_row * kTileEdge, first_row = tile / tiles_per_row * kTileEdge;
  std::vector<GroupPixel> group;
  group.reserve(kGroup);
  for (int n = 0; n < kGroup; ++n) {
    const PixelInTile in_tile = pixel_in_tile(n);
    const int column = first_column + in_tile.column, row = first_row + in_tile.row;
    // The last tiles reach beyond the image.
    const bool inside = column < view.columns && row < view.rows;
    group.push_back({column, row, inside ? static_cast<std::size_t>(row) * view.columns + column : kNowhere});
  }
  return group;
}

std::vector<CpuRenderer::GroupPixel> CpuRenderer::pixels_of_list(const XrayView& view,
                                                                 std::span<const std::uint32_t> pixels,
                                                                 std::span<const std::uint32_t> places) {
  std::vector<GroupPixel> group;
  group.reserve(places.size());
  for (const std::uint32_t place : places) {
    const int pixel = static_cast<int>(pixels[place]);
    group.push_back({pixel % view.columns, pixel / view.columns, place});
  }
  return group;
}

void CpuRenderer::render_group(const XrayView& view, const Camera& camera, std::span<const GroupPixel> group,
                               std::span<float> drr, std::span<MotionDerivatives> derivatives) const {
  std::array<VoxelRay, kGroup> ray_places;
  std::array<float, kGroup> value_places;
  const auto rays = std::span(ray_places).first(group.size());
  const auto values = std::span(value_places).first(group.size());
  for (std::size_t n = 0; n < group.size(); ++n)
    rays[n] = ray_to(group[n].column, group[n].row, camera, mm_from_voxel_axes_);
  std::vector<RayGradient> gradients(derivatives.empty() ? 0 : group.size());
  integrate(rays, view.beam, values, gradients);
  for (std::size_t n = 0; n < gradients.size(); ++n)
    if (group[n].place != kNowhere)
      derivatives[group[n].place] = motion_derivatives(gradients[n], group[n].column, group[n].row, camera);
  for (std::size_t n = 0; n < group.size(); ++n)
    if (group[n].place != kNowhere) drr[group[n].place] = values[n];
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
