#include "drr/cpu/raycast.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/large_vector.h"
#include "base/option_name.h"
#include "base/parallel.h"
#include "drr/cpu/march.h"
#include "drr/of_beam.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// For each main axis, the axes that are a plane's columns and rows.
struct PlaneAxes {
  int column, row;
};
constexpr std::array<PlaneAxes, 3> kPlaneAxes = {
    {{.column = 1, .row = 2}, {.column = 0, .row = 2}, {.column = 0, .row = 1}}};

constexpr int kReadBeyond = 4;  // a pair is loaded as 32 bits

// The box with a border.
template <class T>
std::vector<T> cropped(const std::vector<T>& voxels, const Vector3i& size, const VoxelBox& box) {
  const Vector3i padded = box.size().array() + 3;
  std::vector<T> result = large_vector<T>(padded.cast<std::size_t>().prod() + kReadBeyond);
  const std::size_t slice = static_cast<std::size_t>(padded.x()) * padded.y();
  parallel_for(box.first.z(), box.last.z() + 1, [&](int k) {
    T* out = result.data() + static_cast<std::size_t>(k - box.first.z() + 1) * slice;
    for (int j = box.first.y(); j <= box.last.y(); ++j) {
      const T* row = voxels.data() + (static_cast<std::size_t>(k) * size.y() + j) * size.x();
      std::copy(row + box.first.x(), row + box.last.x() + 1, out + (j - box.first.y() + 1) * padded.x() + 1);
    }
  });
  return result;
}

// The same voxels, y fastest instead of x.
template <class T>
std::vector<T> with_y_fastest(const std::vector<T>& voxels, const Vector3i& size) {
  std::vector<T> result = large_vector<T>(voxels.size());
  const std::size_t slice = static_cast<std::size_t>(size.x()) * size.y();
  parallel_for(0, size.z(), [&](int k) {
    const T* in = voxels.data() + k * slice;
    T* out = result.data() + k * slice;
    for (int y = 0; y < size.y(); ++y)
      for (int x = 0; x < size.x(); ++x) out[x * size.y() + y] = in[y * size.x() + x];
  });
  return result;
}

// Elements from one voxel to the next along each axis.
std::array<std::ptrdiff_t, 3> strides_of(const Vector3i& size, bool y_fastest) {
  const std::ptrdiff_t slice = static_cast<std::ptrdiff_t>(size.x()) * size.y();
  if (y_fastest) return {size.y(), 1, slice};
  return {1, size.x(), slice};
}

// Collects rays along one main axis, all in one direction, and marches when it has enough of them.
template <class T>
class PacketMarcher {
 public:
  // `size` of the padded lattice; line integrals are its sums times `unit_per_mm` and the length per plane. `gradients`
  // is empty if none are wanted.
  PacketMarcher(const PlaneLattice<T>& lattice, const Vector3i& size, int main_axis, double unit_per_mm,
                std::span<float> line_integrals, std::span<RayGradient> gradients)
      : lattice_(lattice),
        size_(size),
        main_axis_(main_axis),
        axes_(kPlaneAxes[main_axis]),
        unit_per_mm_(unit_per_mm),
        line_integrals_(line_integrals),
        gradients_(gradients) {}

  // A ray in voxels of the padded lattice, for the line integral of this index.
  void add(const VoxelRay& ray, std::size_t index) {
    // The last two voxels of the border are there to be read, not to be reached.
    const auto segment = clip_to_box(ray, Vector3d::Zero(), size_.cast<double>().array() - 2.0);
    if (!segment) return;
    const double source = ray.source[main_axis_];
    const double way = ray.way[main_axis_];
    const double at_begin = source + segment->begin * way;
    const double at_end = source + segment->end * way;
    const int first = static_cast<int>(std::ceil(std::min(at_begin, at_end)));
    const int last = std::min(static_cast<int>(std::max(at_begin, at_end)), size_[main_axis_] - 2);
    if (first > last) return;
    if (count_ > 0 && (source != packet_.source_plane || ray.source[axes_.column] != packet_.source_column ||
                       ray.source[axes_.row] != packet_.source_row))
      finish();  // the next row of a line scan
    if (count_ == 0) {
      packet_.plane = first;
      packet_.forward = way > 0.0;
      packet_.source_plane = source;
      packet_.source_column = ray.source[axes_.column];
      packet_.source_row = ray.source[axes_.row];
    }
    const double column_slope = ray.way[axes_.column] / way;
    const double row_slope = ray.way[axes_.row] / way;
    packet_.column_slope[count_] = static_cast<float>(column_slope);
    packet_.row_slope[count_] = static_cast<float>(row_slope);
    packet_.column[count_] = static_cast<float>(ray.source[axes_.column] + (packet_.plane - source) * column_slope);
    packet_.row[count_] = static_cast<float>(ray.source[axes_.row] + (packet_.plane - source) * row_slope);
    packet_.first_plane[count_] = first;
    packet_.last_plane[count_] = last;
    scale_[count_] = static_cast<float>(unit_per_mm_ * ray.length_mm / std::abs(way));
    way_[count_] = way;
    index_[count_] = index;
    if (++count_ == kPacketRays) finish();
  }

  // Marches with those it has.
  void finish() {
    if (count_ == 0) return;
    // Places left empty repeat the first ray, and are not looked at.
    for (auto* values : {&packet_.column, &packet_.row, &packet_.column_slope, &packet_.row_slope})
      std::fill(values->begin() + count_, values->end(), values->front());
    std::fill(packet_.first_plane.begin() + count_, packet_.first_plane.end(), packet_.first_plane.front());
    std::fill(packet_.last_plane.begin() + count_, packet_.last_plane.end(), packet_.last_plane.front());
    if (gradients_.empty()) {
      const PacketSums sums = march(packet_, lattice_);
      for (int n = 0; n < count_; ++n) line_integrals_[index_[n]] = scale_[n] * sums[n];
    } else {
      const PacketGradients sums = march_with_gradients(packet_, lattice_);
      for (int n = 0; n < count_; ++n) {
        line_integrals_[index_[n]] = scale_[n] * sums.value[n];
        gradients_[index_[n]] = gradient_of(sums, n);
      }
    }
    count_ = 0;
  }

 private:
  // In plane p a ray meets column s + (p - m) w / v: s and m are the source's column and plane, w and v the way's. The
  // number of planes on the way, and so the line integral, is as 1 / v.
  RayGradient gradient_of(const PacketGradients& sums, int n) const {
    const double scale = scale_[n], way = way_[n];
    const double from_source = packet_.plane - packet_.source_plane;
    const double by_column = scale * sums.by_column[n], by_row = scale * sums.by_row[n];
    const double by_column_slope = scale * sums.by_column_slope[n] + from_source * by_column;
    const double by_row_slope = scale * sums.by_row_slope[n] + from_source * by_row;
    const double column_slope = packet_.column_slope[n], row_slope = packet_.row_slope[n];
    RayGradient gradient;
    gradient.by_source[axes_.column] = by_column;
    gradient.by_source[axes_.row] = by_row;
    gradient.by_source[main_axis_] = -column_slope * by_column - row_slope * by_row;
    gradient.by_way[axes_.column] = by_column_slope / way;
    gradient.by_way[axes_.row] = by_row_slope / way;
    gradient.by_way[main_axis_] =
        -(column_slope * by_column_slope + row_slope * by_row_slope + scale * sums.value[n]) / way;
    return gradient;
  }

  RayPacket packet_;
  PlaneLattice<T> lattice_;
  Vector3i size_;
  int main_axis_;
  PlaneAxes axes_;
  double unit_per_mm_;
  std::span<float> line_integrals_;
  std::span<RayGradient> gradients_;
  std::array<float, kPacketRays> scale_;
  std::array<double, kPacketRays> way_;  // along the main axis
  std::array<std::size_t, kPacketRays> index_;
  int count_ = 0;
};

}  // namespace

RaycastCpuRenderer::RaycastCpuRenderer(const Volume<float>& ct_hu, const AttenuationModel& model,
                                       std::span<const Beam> beams, const RendererOptions& options)
    : CpuRenderer(ct_hu.patient_from_voxel) {
  const VolumePrecision precision = options.precision.value_or(kDefaultPrecision);
  for (const Beam beam : beams) volumes_.emplace(beam, pack(quantized_attenuation(ct_hu, model, beam, precision)));
}

RaycastCpuRenderer::RaycastCpuRenderer(const AttenuationByBeam& attenuation_per_mm, const RendererOptions& options)
    : CpuRenderer(lattice_of(attenuation_per_mm)) {
  const VolumePrecision precision = options.precision.value_or(kDefaultPrecision);
  for (const auto& [beam, volume] : attenuation_per_mm) volumes_.emplace(beam, pack(quantized(volume, precision)));
}

std::string RaycastCpuRenderer::device() const {
  return fmt::format("{}, {}", CpuRenderer::device(), march_instruction_set());
}

RaycastCpuRenderer::PackedVolume RaycastCpuRenderer::pack(QuantizedVolume attenuation) {
  const VoxelBox box = occupied_voxels(attenuation);
  if (box.is_empty()) return {};
  // Indices are 32 bit numbers of bytes.
  constexpr std::size_t kMaxVoxels = std::size_t{1} << 30;
  const auto voxels_kept = (box.size().array() + 3).cast<std::size_t>().prod();
  if (voxels_kept > kMaxVoxels)
    throw Error(
        fmt::format("what the CT holds above the threshold fills a box of {} voxels; {} can take {}.\n"
                    "       Crop the CT, or use {}",
                    voxels_kept, option("renderer", "cpu"), kMaxVoxels, option("renderer", "raycast")));
  PackedVolume packed{.origin = box.first.cast<double>().array() - 1.0,
                      .size = box.size().array() + 3,
                      .unit_per_mm = attenuation.unit_per_mm};
  std::visit([&](auto& voxels) { voxels = cropped(voxels, attenuation.size, box); }, attenuation.voxels);
  attenuation.size = packed.size;
  packed.blocks = occupied_blocks(attenuation, kSkipEdge);
  packed.x_fastest = std::move(attenuation.voxels);
  std::visit([&](const auto& voxels) { packed.y_fastest = with_y_fastest(voxels, packed.size); }, packed.x_fastest);
  return packed;
}

template <class T>
PlaneLattice<T> RaycastCpuRenderer::PackedVolume::lattice(int main_axis) const {
  const PlaneAxes axes = kPlaneAxes[main_axis];
  const bool swizzled = main_axis == 0;
  const std::array<std::ptrdiff_t, 3> strides = strides_of(size, swizzled);
  const std::array<std::ptrdiff_t, 3> block_strides = strides_of(blocks.size, false);
  return {.voxels = std::get<std::vector<T>>(swizzled ? y_fastest : x_fastest).data(),
          .plane_stride = strides[main_axis],
          .row_stride = strides[axes.row],
          .columns = size[axes.column],
          .rows = size[axes.row],
          .occupied = blocks.occupied.data(),
          .plane_block_stride = block_strides[main_axis],
          .column_block_stride = block_strides[axes.column],
          .row_block_stride = block_strides[axes.row]};
}

void RaycastCpuRenderer::integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals,
                                   std::span<RayGradient> gradients) const {
  const PackedVolume& volume = of_beam(volumes_, beam);
  std::ranges::fill(line_integrals, 0.0F);
  std::ranges::fill(gradients, RayGradient());
  if (volume.size.isZero()) return;
  std::visit(
      [&]<class T>(const std::vector<T>&) {
        const auto marcher = [&](int axis) {
          return PacketMarcher<T>(volume.lattice<T>(axis), volume.size, axis, volume.unit_per_mm, line_integrals,
                                  gradients);
        };
        // Of each main axis one for rays with it and one for those against it.
        std::array marchers = {marcher(0), marcher(0), marcher(1), marcher(1), marcher(2), marcher(2)};
        for (std::size_t n = 0; n < rays.size(); ++n) {
          VoxelRay ray = rays[n];
          ray.source -= volume.origin;
          int main_axis = 0;  // along which it runs fastest, in voxels
          ray.way.cwiseAbs().maxCoeff(&main_axis);
          const int against = ray.way[main_axis] < 0.0 ? 1 : 0;
          marchers[2 * main_axis + against].add(ray, n);
        }
        for (PacketMarcher<T>& rest : marchers) rest.finish();
      },
      volume.x_fastest);
}

}  // namespace isoshift
