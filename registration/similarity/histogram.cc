#include "registration/similarity/histogram.h"

#include <cmath>

namespace isoshift {

Range range_of(std::span<const float> values) {
  if (values.empty()) return {};
  const auto [low, high] = std::ranges::minmax(values);
  return {.low = low, .per_unit = high > low ? 1.0F / (high - low) : 0.0F};
}

Range wide_range_of(std::span<const float> values) {
  if (values.empty()) return {};
  constexpr float kWider = 0.1F;
  const auto [low, high] = std::ranges::minmax(values);
  const float margin = kWider * (high - low);
  return range_of(std::array{low - margin, high + margin});
}

Place place_of(float value, const Range& range, int bins) {
  const auto last = static_cast<float>(bins - 1);
  const float per_unit = range.per_unit * last;  // first, so that 8-bit values meet the middles of 256 bins
  const float place = std::clamp((value - range.low) * per_unit, 0.0F, last);
  const int lower = std::min(bins - 2, static_cast<int>(place));
  const float beyond = place - static_cast<float>(lower);
  return {.lower = static_cast<std::size_t>(lower),
          .beyond = beyond,
          .shares = static_cast<std::uint32_t>(std::lround(beyond * static_cast<float>(kSharesPerPixel)))};
}

float bins_per_unit(float value, const Range& range, int bins) {
  const float share = (value - range.low) * range.per_unit;
  return share > 0.0F && share < 1.0F ? range.per_unit * static_cast<float>(bins - 1) : 0.0F;
}

RankedPlaces ranked_places(std::span<const float> values, const Range& range) {
  RankedPlaces ranked;
  ranked.places.reserve(values.size());
  std::array<std::uint32_t, kRankBins> counts = {};
  for (const float value : values) {
    const Place& place = ranked.places.emplace_back(place_of(value, range, kRankBins));
    counts[place.lower] += kSharesPerPixel - place.shares;
    counts[place.lower + 1] += place.shares;
  }
  double below = 0.0;  // in pixels
  for (std::size_t bin = 0; bin < counts.size(); ++bin) {
    const double count = static_cast<double>(counts[bin]) / kSharesPerPixel;
    ranked.of_middles[bin] = static_cast<float>(below + 0.5 * (count - 1.0));
    below += count;
  }
  return ranked;
}

std::vector<float> RankedPlaces::ranks() const {
  std::vector<float> ranks;
  ranks.reserve(places.size());
  for (const Place& place : places)
    ranks.push_back(of_middles[place.lower] + place.beyond * (of_middles[place.lower + 1] - of_middles[place.lower]));
  return ranks;
}

}  // namespace isoshift
