// Compiled once per instruction set by Highway, which chooses among them at run time. Not for vectors whose length is
// known only then: they cannot be members.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "drr/cpu/march.cc"
#include <hwy/foreach_target.h>
// Highway must know the targets before its main header.
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "drr/cpu/march.h"
#include "drr/cpu/planes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace isoshift {
namespace HWY_NAMESPACE {

// A packet's rays leave the source like a pyramid, whose sides bound them in every plane.
class Pyramid {
 public:
  explicit Pyramid(const RayPacket& packet)
      : plane_(packet.source_plane), column_(packet.source_column), row_(packet.source_row) {
    const auto [column_min, column_max] = std::minmax_element(packet.column_slope.begin(), packet.column_slope.end());
    const auto [row_min, row_max] = std::minmax_element(packet.row_slope.begin(), packet.row_slope.end());
    // Rays against the main axis reach planes before the source, where the sides have changed places.
    const bool forward = packet.forward;
    column_low_ = forward ? *column_min : *column_max;
    column_high_ = forward ? *column_max : *column_min;
    row_low_ = forward ? *row_min : *row_max;
    row_high_ = forward ? *row_max : *row_min;
  }

  HWY_INLINE Footprint in(int plane) const {
    const double way = plane - plane_;
    return {static_cast<float>(column_ + way * column_low_), static_cast<float>(column_ + way * column_high_),
            static_cast<float>(row_ + way * row_low_), static_cast<float>(row_ + way * row_high_)};
  }

 private:
  double plane_, column_, row_;
  double column_low_, column_high_, row_low_, row_high_;
};

// Whether all blocks that the packet meets between two planes of one layer of blocks are empty.
template <class T>
HWY_INLINE bool is_empty(const Footprint& a, const Footprint& b, int plane, const PlaneLattice<T>& lattice) {
  const auto block = [](float low, int last) { return std::clamp(static_cast<int>(low), 0, last) / kSkipEdge; };
  const int first_column = block(std::min(a.column_low, b.column_low), lattice.columns - 1);
  const int last_column = block(std::max(a.column_high, b.column_high) + 1.0F, lattice.columns - 1);
  const int first_row = block(std::min(a.row_low, b.row_low), lattice.rows - 1);
  const int last_row = block(std::max(a.row_high, b.row_high) + 1.0F, lattice.rows - 1);
  const std::uint8_t* layer = lattice.occupied + plane / kSkipEdge * lattice.plane_block_stride;
  for (int row = first_row; row <= last_row; ++row)
    for (int column = first_column; column <= last_column; ++column)
      if (layer[row * lattice.row_block_stride + column * lattice.column_block_stride] != 0) return false;
  return true;
}

HWY_INLINE void add(FloatVec value, float* sum) { hn::Store(hn::Add(value, hn::Load(Floats(), sum)), Floats(), sum); }

// A sample of the rays from number n, `steps` planes from the packet's, added to what is asked for. `keep` makes 0 of
// rays that do not count here.
template <class Keep>
HWY_INLINE void add(const Sample& sample, FloatVec, std::size_t n, const Keep& keep, PacketSums& sums) {
  add(keep(sample.value), &sums[n]);
}
template <class Keep>
HWY_INLINE void add(const Sample& sample, FloatVec steps, std::size_t n, const Keep& keep, PacketGradients& sums) {
  const FloatVec by_column = keep(sample.by_column), by_row = keep(sample.by_row);
  add(keep(sample.value), &sums.value[n]);
  add(by_column, &sums.by_column[n]);
  add(by_row, &sums.by_row[n]);
  add(hn::Mul(steps, by_column), &sums.by_column_slope[n]);
  add(hn::Mul(steps, by_row), &sums.by_row_slope[n]);
}

void clear(PacketSums& sums) { sums.fill(0.0F); }
void clear(PacketGradients& sums) {
  for (PacketSums* part : {&sums.value, &sums.by_column, &sums.by_row, &sums.by_column_slope, &sums.by_row_slope})
    part->fill(0.0F);
}

// Adds up all planes; `Plane` says how a plane's voxels are fetched, `Sums` what is summed.
template <class Plane, class T, class Sums>
HWY_NOINLINE void march_through(const RayPacket& packet, const Pyramid& pyramid, const PlaneLattice<T>& lattice,
                                Sums& sums) {
  constexpr std::size_t kLanes = HWY_MIN(HWY_LANES(float), kPacketRays);
  constexpr std::size_t kParts = kPacketRays / kLanes;
  const int first = *std::min_element(packet.first_plane.begin(), packet.first_plane.end());
  const int last = *std::max_element(packet.last_plane.begin(), packet.last_plane.end());
  const int all_from = *std::max_element(packet.first_plane.begin(), packet.first_plane.end());
  const int all_to = *std::min_element(packet.last_plane.begin(), packet.last_plane.end());

  clear(sums);
  for (int begin = first; begin <= last; begin = begin / kSkipEdge * kSkipEdge + kSkipEdge) {
    const int end = std::min(last, begin / kSkipEdge * kSkipEdge + kSkipEdge - 1);
    if (is_empty(pyramid.in(begin), pyramid.in(end), begin, lattice)) continue;
    for (int plane = begin; plane <= end; ++plane) {
      if (plane + Plane::kPrefetch <= last)
        Plane::prefetch(lattice, plane + Plane::kPrefetch, pyramid.in(plane + Plane::kPrefetch));
      const Plane values(lattice, plane, pyramid.in(plane));
      const FloatVec steps = hn::Set(Floats(), static_cast<float>(plane - packet.plane));
      for (std::size_t part = 0; part < kParts; ++part) {
        const std::size_t n = part * kLanes;
        const FloatVec column =
            hn::MulAdd(steps, hn::Load(Floats(), &packet.column_slope[n]), hn::Load(Floats(), &packet.column[n]));
        const FloatVec row =
            hn::MulAdd(steps, hn::Load(Floats(), &packet.row_slope[n]), hn::Load(Floats(), &packet.row[n]));
        const Sample sample = values(column, row);
        if (plane < all_from || plane > all_to) {
          const IntVec here = hn::Set(Ints(), plane);
          const auto outside = hn::RebindMask(Floats(), hn::Or(hn::Gt(hn::Load(Ints(), &packet.first_plane[n]), here),
                                                               hn::Gt(here, hn::Load(Ints(), &packet.last_plane[n]))));
          add(sample, steps, n, [&](FloatVec value) { return hn::IfThenZeroElse(outside, value); }, sums);
        } else {
          add(sample, steps, n, [](FloatVec value) { return value; }, sums);
        }
      }
    }
  }
}

template <class T, class Sums>
void march_all(const RayPacket& packet, const PlaneLattice<T>& lattice, Sums& sums) {
  const Pyramid pyramid(packet);
#if HWY_TARGET <= HWY_SSSE3  // on x86
  if constexpr (sizeof(T) <= 2) {
    const Footprint a = pyramid.in(*std::min_element(packet.first_plane.begin(), packet.first_plane.end()));
    const Footprint b = pyramid.in(*std::max_element(packet.last_plane.begin(), packet.last_plane.end()));
    if (SmallWindow<T>::fits(a, b, lattice)) return march_through<SmallWindow<T>>(packet, pyramid, lattice, sums);
    if (LargeWindow<T>::fits(a, b, lattice)) return march_through<LargeWindow<T>>(packet, pyramid, lattice, sums);
  }
#endif
  march_through<GatherPlane<T>>(packet, pyramid, lattice, sums);
}

void march_u8(const RayPacket& packet, const PlaneLattice<std::uint8_t>& lattice, PacketSums& sums) {
  march_all(packet, lattice, sums);
}
void gradients_u8(const RayPacket& packet, const PlaneLattice<std::uint8_t>& lattice, PacketGradients& sums) {
  march_all(packet, lattice, sums);
}
void march_u16(const RayPacket& packet, const PlaneLattice<std::uint16_t>& lattice, PacketSums& sums) {
  march_all(packet, lattice, sums);
}
void gradients_u16(const RayPacket& packet, const PlaneLattice<std::uint16_t>& lattice, PacketGradients& sums) {
  march_all(packet, lattice, sums);
}
void march_f32(const RayPacket& packet, const PlaneLattice<float>& lattice, PacketSums& sums) {
  march_all(packet, lattice, sums);
}
void gradients_f32(const RayPacket& packet, const PlaneLattice<float>& lattice, PacketGradients& sums) {
  march_all(packet, lattice, sums);
}

const char* instruction_set() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace isoshift
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isoshift {

HWY_EXPORT(march_u8);
HWY_EXPORT(march_u16);
HWY_EXPORT(march_f32);
HWY_EXPORT(gradients_u8);
HWY_EXPORT(gradients_u16);
HWY_EXPORT(gradients_f32);
HWY_EXPORT(instruction_set);

PacketSums march(const RayPacket& packet, const PlaneLattice<std::uint8_t>& lattice) {
  alignas(64) PacketSums sums;
  HWY_DYNAMIC_DISPATCH(march_u8)(packet, lattice, sums);
  return sums;
}
PacketGradients march_with_gradients(const RayPacket& packet, const PlaneLattice<std::uint8_t>& lattice) {
  PacketGradients sums;
  HWY_DYNAMIC_DISPATCH(gradients_u8)(packet, lattice, sums);
  return sums;
}
PacketSums march(const RayPacket& packet, const PlaneLattice<std::uint16_t>& lattice) {
  alignas(64) PacketSums sums;
  HWY_DYNAMIC_DISPATCH(march_u16)(packet, lattice, sums);
  return sums;
}
PacketGradients march_with_gradients(const RayPacket& packet, const PlaneLattice<std::uint16_t>& lattice) {
  PacketGradients sums;
  HWY_DYNAMIC_DISPATCH(gradients_u16)(packet, lattice, sums);
  return sums;
}
PacketSums march(const RayPacket& packet, const PlaneLattice<float>& lattice) {
  alignas(64) PacketSums sums;
  HWY_DYNAMIC_DISPATCH(march_f32)(packet, lattice, sums);
  return sums;
}
PacketGradients march_with_gradients(const RayPacket& packet, const PlaneLattice<float>& lattice) {
  PacketGradients sums;
  HWY_DYNAMIC_DISPATCH(gradients_f32)(packet, lattice, sums);
  return sums;
}

const char* march_instruction_set() { return HWY_DYNAMIC_DISPATCH(instruction_set)(); }

}  // namespace isoshift
#endif
