#pragma once
// Mean and standard deviation.

#include <cmath>
#include <span>

namespace isoshift {

struct MeanAndSd {
  double mean = 0.0, sd = 0.0;  // of the sample, over n - 1; 0 for a single value
};

inline MeanAndSd mean_and_sd_of(std::span<const double> values) {
  MeanAndSd result;
  const auto count = static_cast<double>(values.size());
  for (const double value : values) result.mean += value / count;
  for (const double value : values) result.sd += std::pow(value - result.mean, 2);
  result.sd = values.size() > 1 ? std::sqrt(result.sd / (count - 1.0)) : 0.0;
  return result;
}

}  // namespace isoshift
