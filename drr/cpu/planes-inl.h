// How the `cpu` renderer fetches the voxels that a packet of rays meets in a plane. Included once per instruction set
// by march.cc, inside of what Highway compiles again and again; hence no #pragma once.

#if defined(ISOSHIFT_DRR_CPU_PLANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef ISOSHIFT_DRR_CPU_PLANES_INL_H
#undef ISOSHIFT_DRR_CPU_PLANES_INL_H
#else
#define ISOSHIFT_DRR_CPU_PLANES_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstdint>

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

// A window of a plane's voxels around a packet, inside of the lattice.
template <int kColumns, int kRows>
struct Window {
  int first_column, first_row;

  template <class T>
  HWY_INLINE Window(const PlaneLattice<T>& lattice, const Footprint& footprint)
      : first_column(std::clamp(static_cast<int>(footprint.column_low), 0, lattice.columns - kColumns)),
        first_row(std::clamp(static_cast<int>(footprint.row_low), 0, lattice.rows - kRows)) {}

  template <class T>
  HWY_INLINE const T* voxels(const PlaneLattice<T>& lattice, int plane) const {
    return lattice.voxels + plane * lattice.plane_stride + first_row * lattice.row_stride + first_column;
  }

  // Whether it holds all that a packet meets from one footprint to another. The right neighbor belongs to it, and a
  // part of a voxel is left to rounding.
  template <class T>
  static bool fits(const Footprint& a, const Footprint& b, const PlaneLattice<T>& lattice, float rounding) {
    const float most_width = kColumns - 2.0F - rounding, most_height = kRows - 2.0F - rounding;
    return std::max(a.column_high - a.column_low, b.column_high - b.column_low) <= most_width &&
           std::max(a.row_high - a.row_low, b.row_high - b.row_low) <= most_height && lattice.columns >= kColumns &&
           lattice.rows >= kRows;
  }
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
    return Window<kColumns, kRows>::fits(a, b, lattice, 0.5F);
  }

  HWY_INLINE WindowPlane(const PlaneLattice<T>& lattice, int plane, const Footprint& footprint)
      : window_(lattice, footprint) {
    const T* base = window_.voxels(lattice, plane);
    for (int n = 0; n < kTables; ++n) tables_[n] = load(base, lattice.row_stride, n);
  }

  HWY_INLINE Sample operator()(FloatVec column, FloatVec row) const {
    column = hn::Sub(column, hn::Set(Floats(), static_cast<float>(window_.first_column)));
    row = hn::Sub(row, hn::Set(Floats(), static_cast<float>(window_.first_row)));
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

  Window<kColumns, kRows> window_;
  __m512i tables_[kTables];
};

template <class T>
using SmallWindow = WindowPlane<8, T>;
template <class T>
using LargeWindow = WindowPlane<16, T>;
#elif HWY_TARGET <= HWY_SSSE3
// The same from kRows rows that are as many voxels wide as 16 bytes hold. Every row is looked up for every ray, which
// keeps the two beside it.
template <int kRows, class T>
class WindowPlane {
 public:
  static constexpr int kColumns = 16 / sizeof(T);

  static constexpr int kPrefetch = 8;
  static HWY_INLINE void prefetch(const PlaneLattice<T>& lattice, int plane, const Footprint& footprint) {
    const T* base = Window<kColumns, kRows>(lattice, footprint).voxels(lattice, plane);
    for (int n = 0; n < kRows; ++n) __builtin_prefetch(base + n * lattice.row_stride);
  }

  static bool fits(const Footprint& a, const Footprint& b, const PlaneLattice<T>& lattice) {
    return Window<kColumns, kRows>::fits(a, b, lattice, 0.1F);
  }

  HWY_INLINE WindowPlane(const PlaneLattice<T>& lattice, int plane, const Footprint& footprint)
      : window_(lattice, footprint) {
    const T* base = window_.voxels(lattice, plane);
    for (int n = 0; n < kRows; ++n)
      rows_[n] = hn::LoadDup128(Bytes(), reinterpret_cast<const std::uint8_t*>(base + n * lattice.row_stride));
  }

  HWY_INLINE Sample operator()(FloatVec column, FloatVec row) const {
    column = hn::Sub(column, hn::Set(Floats(), static_cast<float>(window_.first_column)));
    row = hn::Sub(row, hn::Set(Floats(), static_cast<float>(window_.first_row)));
    const IntVec whole_column = hn::ConvertTo(Ints(), column);
    const auto places = places_of(whole_column);
    WordVec near = look_up(0, places), far = look_up(1, places);
    FloatVec whole_row = hn::Zero(Floats());
    for (int n = 1; n < kRows - 1; ++n) {
      const FloatVec here = hn::Set(Floats(), static_cast<float>(n));
      const auto reached = hn::Ge(row, here);
      const auto words = hn::RebindMask(Words(), reached);
      near = hn::IfThenElse(words, look_up(n, places), near);
      far = hn::IfThenElse(words, look_up(n + 1, places), far);
      whole_row = hn::IfThenElse(reached, here, whole_row);
    }
    return bilinear(unpack(near, 16), unpack(far, 16), hn::Sub(column, hn::ConvertTo(Floats(), whole_column)),
                    hn::Sub(row, whole_row));
  }

 private:
  using Bytes = hn::Repartition<std::uint8_t, Words>;
  using ByteVec = hn::Vec<Bytes>;

  // For each ray the bytes of its column and the next, as two numbers of 16 bits. An index of 0x80 looks up 0.
  static HWY_INLINE ByteVec places_of(IntVec column) {
    const IntVec places =
        sizeof(T) == 1
            ? hn::Add(hn::Mul(column, hn::Set(Ints(), 0x00010001)), hn::BitCast(Ints(), hn::Set(Words(), 0x80018000U)))
            : hn::Add(hn::Mul(column, hn::Set(Ints(), 0x02020202)), hn::Set(Ints(), 0x03020100));
    return hn::BitCast(Bytes(), places);
  }
  HWY_INLINE WordVec look_up(int row, ByteVec places) const {
    return hn::BitCast(Words(), hn::TableLookupBytesOr0(rows_[row], places));
  }

  Window<kColumns, kRows> window_;
  ByteVec rows_[kRows];
};

template <class T>
using SmallWindow = WindowPlane<4, T>;
template <class T>
using LargeWindow = WindowPlane<5, T>;
#endif

}  // namespace HWY_NAMESPACE
}  // namespace isoshift
HWY_AFTER_NAMESPACE();

#endif  // ISOSHIFT_DRR_CPU_PLANES_INL_H
