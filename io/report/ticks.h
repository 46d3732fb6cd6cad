#pragma once
// The positions of the ticks on a chart's axis.

#include <cmath>
#include <vector>

namespace isoshift {

// About seven multiples of 1, 2 or 5 times a power of ten, from `low` to `high`.
inline std::vector<double> ticks(double low, double high) {
  constexpr double kSteps = 6.0, kRounding = 1e-4;
  const double rough = (high - low) / kSteps, power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * power >= rough) step = factor * power;
  std::vector<double> result;
  const int first = static_cast<int>(std::ceil(low / step - kRounding));
  const int last = static_cast<int>(std::floor(high / step + kRounding));
  for (int n = first; n <= last; ++n) result.push_back(n * step);
  return result;
}

}  // namespace isoshift
