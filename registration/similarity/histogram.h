#pragma once
// Bins between which a DRR's pixels are shared, by distance, in units of 1 / kSharesPerPixel: windows that are
// B-splines of first order. Counts, and all that follows from them, change continuously with the DRR. The range of the
// bins is that of a whole search stage: no single extreme pixel moves them.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace isoshift {

// Values as shares of a range, 0 to 1; what lies beyond it counts as its end. A range of no width makes all of them 0.
struct Range {
  float low = 0.0F, per_unit = 0.0F;
  float operator()(float value) const { return std::clamp((value - low) * per_unit, 0.0F, 1.0F); }
};
Range range_of(std::span<const float> values);       // from the least to the largest
Range wide_range_of(std::span<const float> values);  // a tenth wider at both ends

inline constexpr int kSharesPerPixel = 256;

// Where a value lies among bins over a range: between the middles of bin `lower` and of the next.
struct Place {
  std::size_t lower = 0;
  float beyond = 0.0F;       // 0 at the middle of `lower`, 1 at that of the next
  std::uint32_t shares = 0;  // of the next bin
};
Place place_of(float value, const Range& range, int bins);

// How far a value moves among the bins, per unit; 0 beyond the range.
float bins_per_unit(float value, const Range& range, int bins);

// Where the values of a list lie among kRankBins bins, and the rank at the middle of every bin: that of half its
// pixels; 0 is the first. Between the middles of two bins, ranks grow linearly.
inline constexpr int kRankBins = 256;
struct RankedPlaces {
  std::vector<Place> places;
  std::array<float, kRankBins> of_middles = {};

  std::vector<float> ranks() const;
};
RankedPlaces ranked_places(std::span<const float> values, const Range& range);

}  // namespace isoshift
