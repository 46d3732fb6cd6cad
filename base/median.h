#pragma once

#include <algorithm>
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

}  // namespace isoshift
