#include "registration/similarity/ncc.h"

#include <cassert>
#include <cmath>
#include <cstddef>

namespace isoshift {

double normalized_cross_correlation(std::span<const float> a, std::span<const float> b) {
  assert(a.size() == b.size());
  const auto n = static_cast<double>(a.size());
  double sum_a = 0.0, sum_b = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum_a += a[i];
    sum_b += b[i];
  }
  // A second pass about the means: sums of squares of large line integrals would cancel.
  double aa = 0.0, bb = 0.0, ab = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double da = a[i] - sum_a / n;
    const double db = b[i] - sum_b / n;
    aa += da * da;
    bb += db * db;
    ab += da * db;
  }
  if (!(aa > 0.0 && bb > 0.0)) return 0.0;
  return ab / std::sqrt(aa * bb);
}

}  // namespace isoshift
