#include "registration/similarity/similarity.h"

#include <cassert>
#include <cmath>
#include <cstddef>

namespace isoshift {

std::string_view to_string(SimilarityKind kind) {
  return kind == SimilarityKind::kNcc ? "ncc" : "gradient-correlation";
}

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

Gradients gradients(std::span<const float> pixels, std::span<const Neighbors> neighbors) {
  Gradients result;
  result.along_row.reserve(neighbors.size());
  result.along_column.reserve(neighbors.size());
  for (const Neighbors& at : neighbors) {
    result.along_row.push_back(pixels[at.right] - pixels[at.left]);
    result.along_column.push_back(pixels[at.below] - pixels[at.above]);
  }
  return result;
}

double gradient_correlation(const Gradients& a, const Gradients& b) {
  return 0.5 * (normalized_cross_correlation(a.along_row, b.along_row) +
                normalized_cross_correlation(a.along_column, b.along_column));
}

}  // namespace isoshift
