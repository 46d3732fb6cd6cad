#pragma once
// Where the ticks of a chart's axis stand.

#include <cmath>

namespace isoshift {

// 1, 2 or 5 times a power of ten, so that about six steps make the range.
inline double tick_step(double range) {
  constexpr int kTicks = 6;
  const double rough = range / kTicks;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double factor : {1.0, 2.0, 5.0})
    if (factor * power >= rough) return factor * power;
  return 10.0 * power;
}

}  // namespace isoshift
