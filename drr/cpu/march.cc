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

HWY_BEFORE_NAMESPACE();
namespace isoshift {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kPacketRays>;
using Ints = hn::Rebind<std::int32_t, Floats>;
using Words = hn::Rebind<std::uint32_t, Floats>;
using FloatVec = hn::Vec<Floats>;
using IntVec = hn::Vec<Ints>;
using WordVec = hn::Vec<Words>;

// Two neighbors in a row.
struct Pair {
  FloatVec left, right;
};

HWY_INLINE Pair unpack(WordVec words, int bits) {
  const WordVec mask = hn::Set(Words(), (1U << bits) - 1U);
  return {hn::ConvertTo(Floats(), hn::BitCast(Ints(), hn::And(words, mask))),
          hn::ConvertTo(Floats(), hn::BitCast(Ints(), hn::And(hn::ShiftRightSame(words, bits), mask)))};
}

// One load brings both neighbors where a voxel has 8 or 16 bits; such loads need not be aligned.
HWY_INLINE Pair gather_pair(const std::uint8_t* base, IntVec index) {
  return unpack(hn::GatherOffset(Words(), reinterpret_cast<const std::uint32_t*>(base), index), 8);
}
HWY_INLINE Pair gather_pair(const std::uint16_t* base, IntVec index) {
  return unpack(hn::GatherOffset(Words(), reinterpret_cast<const std::uint32_t*>(base), hn::ShiftLeft<1>(index)), 16);
}
HWY_INLINE Pair gather_pair(const float* base, IntVec index) {
  return {hn::GatherIndex(Floats(), base, index), hn::GatherIndex(Floats(), base + 1, index)};
}

// An interpolated value and its derivatives; what is not used of it is not computed.
struct Sample {
  FloatVec value, by_column, by_row;
};

HWY_INLINE Sample bilinear(const Pair& near, const Pair& far, FloatVec column_fraction, FloatVec row_fraction) {
  const FloatVec near_slope = hn::Sub(near.right, near.left), far_slope = hn::Sub(far.right, far.left);
  const FloatVec near_value = hn::MulAdd(column_fraction, near_slope, near.left);
  const FloatVec far_value = hn::MulAdd(column_fraction, far_slope, far.left);
  const FloatVec by_row = hn::Sub(far_value, near_value);
  return {.value = hn::MulAdd(row_fraction, by_row, near_value),
          .by_column = hn::MulAdd(row_fraction, hn::Sub(far_slope, near_slope), near_slope),
          .by_row = by_row};
}

// What a packet covers of a plane: from the lowest to the highest column and row of its rays.
struct Footprint {
  float column_low, column_high, row_low, row_high;
};

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

// Values wherever the rays are in a plane, one load per ray.
template <class T>
class GatherPlane {
 public:
  // Rays far apart share few cache lines: without fetching them some planes ahead 5 % of an image took 2.5 times as
  // long.
  static constexpr int kPrefetch = 8;

  static HWY_INLINE void prefetch(const PlaneLattice<T>& lattice, int plane, const Footprint& footprint) {
    const int last_row = std::min(static_cast<int>(footprint.row_high) + 1, lattice.rows - 1);
    const int first_column = std::clamp(static_cast<int>(footprint.column_low), 0, lattice.columns - 1);
    const int last_column = std::clamp(static_cast<int>(footprint.column_high) + 1, 0, lattice.columns - 1);
    for (int row = std::max(0, static_cast<int>(footprint.row_low)); row <= last_row; ++row) {
      const T* voxels = lattice.voxels + plane * lattice.plane_stride + row * lattice.row_stride;
      __builtin_prefetch(voxels + first_column);
      __builtin_prefetch(voxels + last_column);
    }
  }

  HWY_INLINE GatherPlane(const PlaneLattice<T>& lattice, int plane, const Footprint& footprint) : lattice_(lattice) {
    row_origin_ = std::clamp(static_cast<int>(footprint.row_low), 0, lattice.rows - 2);
    base_ = lattice.voxels + plane * lattice.plane_stride + row_origin_ * lattice.row_stride;
  }

  HWY_INLINE Sample operator()(FloatVec column, FloatVec row) const {
    // Rays that do not count here may be anywhere: into the lattice with them.
    const FloatVec zero = hn::Zero(Floats());
    column = hn::Min(hn::Max(column, zero), hn::Set(Floats(), static_cast<float>(lattice_.columns - 2)));
    row = hn::Min(hn::Max(hn::Sub(row, hn::Set(Floats(), static_cast<float>(row_origin_))), zero),
                  hn::Set(Floats(), static_cast<float>(lattice_.rows - 2 - row_origin_)));
    const IntVec whole_column = hn::ConvertTo(Ints(), column);
    const IntVec whole_row = hn::ConvertTo(Ints(), row);
    const IntVec stride = hn::Set(Ints(), static_cast<std::int32_t>(lattice_.row_stride));
    const IntVec index = hn::Add(whole_column, hn::Mul(whole_row, stride));
    return bilinear(gather_pair(base_, index), gather_pair(base_ + lattice_.row_stride, index),
                    hn::Sub(column, hn::ConvertTo(Floats(), whole_column)),
                    hn::Sub(row, hn::ConvertTo(Floats(), whole_row)));
  }

 private:
  const PlaneLattice<T>& lattice_;
  int row_origin_;
  const T* base_;
};

#if HWY_TARGET <= HWY_AVX3
// The same from a window of voxels that is loaded whole and looked up in registers: on AVX-512 several times as fast as
// gathering, where neighboring rays are at most a few voxels apart.
template <int kColumns, class T>
class WindowPlane {
 public:
  static constexpr int kPrefetch = 0;  // 8 planes ahead made no difference here
  static void prefetch(const PlaneLattice<T>&, int, const Footprint&) {}

  static constexpr int kRows = 8;

  static bool fits(const Footprint& a, const Footprint& b, const PlaneLattice<T>& lattice) {
    // The right neighbor belongs to the window; half a voxel is left to rounding.
    constexpr float kMaxWidth = kColumns - 2.5F, kMaxHeight = kRows - 2.5F;
    return std::max(a.column_high - a.column_low, b.column_high - b.column_low) <= kMaxWidth &&
           std::max(a.row_high - a.row_low, b.row_high - b.row_low) <= kMaxHeight && lattice.columns >= kColumns &&
           lattice.rows >= kRows;
  }

  HWY_INLINE WindowPlane(const PlaneLattice<T>& lattice, int plane, const Footprint& footprint)
      : column_origin_(std::clamp(static_cast<int>(footprint.column_low), 0, lattice.columns - kColumns)),
        row_origin_(std::clamp(static_cast<int>(footprint.row_low), 0, lattice.rows - kRows)) {
    const T* base = lattice.voxels + plane * lattice.plane_stride + row_origin_ * lattice.row_stride + column_origin_;
    for (int n = 0; n < kTables; ++n) tables_[n] = load(base, lattice.row_stride, n);
  }

  HWY_INLINE Sample operator()(FloatVec column, FloatVec row) const {
    column = hn::Sub(column, hn::Set(Floats(), static_cast<float>(column_origin_)));
    row = hn::Sub(row, hn::Set(Floats(), static_cast<float>(row_origin_)));
    const IntVec whole_column = hn::ConvertTo(Ints(), column);
    const IntVec whole_row = hn::ConvertTo(Ints(), row);
    const IntVec index = hn::Add(whole_column, hn::Mul(whole_row, hn::Set(Ints(), kColumns)));
    // Both neighbors' places in one 32-bit lane: a lookup of 16-bit lanes then returns both.
    const IntVec left_and_right = hn::Add(hn::Or(index, hn::ShiftLeft<16>(index)), hn::Set(Ints(), 0x10000));
    const IntVec next_row = hn::Set(Ints(), kColumns * 0x10001);
    return bilinear(unpack(look_up(left_and_right), 16), unpack(look_up(hn::Add(left_and_right, next_row)), 16),
                    hn::Sub(column, hn::ConvertTo(Floats(), whole_column)),
                    hn::Sub(row, hn::ConvertTo(Floats(), whole_row)));
  }

 private:
  static constexpr int kTables = kRows * kColumns / 32;

  // 8 or 16 voxels of a row, as 16 bits each.
  static __m128i eight(const std::uint16_t* row) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(row)); }
  static __m128i eight(const std::uint8_t* row) {
    return _mm_cvtepu8_epi16(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(row)));
  }
  static __m256i sixteen(const std::uint16_t* row) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(row)); }
  static __m256i sixteen(const std::uint8_t* row) {
    return _mm256_cvtepu8_epi16(_mm_loadu_si128(reinterpret_cast<const __m128i*>(row)));
  }

  // Table n: its share of the window's rows, one after the other.
  static __m512i load(const T* base, std::ptrdiff_t row_stride, int n) {
    if constexpr (kColumns == 8) {
      const auto row = [&](int r) { return eight(base + (4 * n + r) * row_stride); };
      const __m256i low = _mm256_inserti128_si256(_mm256_castsi128_si256(row(0)), row(1), 1);
      const __m256i high = _mm256_inserti128_si256(_mm256_castsi128_si256(row(2)), row(3), 1);
      return _mm512_inserti64x4(_mm512_castsi256_si512(low), high, 1);
    } else {
      const auto row = [&](int r) { return sixteen(base + (2 * n + r) * row_stride); };
      return _mm512_inserti64x4(_mm512_castsi256_si512(row(0)), row(1), 1);
    }
  }

  WordVec look_up(IntVec index) const {
    const __m512i first = _mm512_permutex2var_epi16(tables_[0], index.raw, tables_[1]);
    if constexpr (kTables == 2) {
      return WordVec{first};
    } else {
      const __m512i second = _mm512_permutex2var_epi16(tables_[2], index.raw, tables_[3]);
      const __mmask32 in_second = _mm512_test_epi16_mask(index.raw, _mm512_set1_epi16(64));
      return WordVec{_mm512_mask_blend_epi16(in_second, first, second)};
    }
  }

  int column_origin_, row_origin_;
  __m512i tables_[kTables];
};
#endif

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
#if HWY_TARGET <= HWY_AVX3
  if constexpr (sizeof(T) <= 2) {
    const Footprint a = pyramid.in(*std::min_element(packet.first_plane.begin(), packet.first_plane.end()));
    const Footprint b = pyramid.in(*std::max_element(packet.last_plane.begin(), packet.last_plane.end()));
    using Small = WindowPlane<8, T>;
    using Large = WindowPlane<16, T>;
    if (Small::fits(a, b, lattice)) return march_through<Small>(packet, pyramid, lattice, sums);
    if (Large::fits(a, b, lattice)) return march_through<Large>(packet, pyramid, lattice, sums);
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
