#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace isoshift {

// The value in the middle; of an even number of values the larger of the two. There is at least one.
template <class T>
T median(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// The value that a share of the values do not exceed, between two values linearly. There is at least one.
inline double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const double above = values[std::min(below + 1, values.size() - 1)];
  return std::lerp(values[below], above, place - static_cast<double>(below));
}

}  // namespace isoshift
