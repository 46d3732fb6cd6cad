#pragma once
// Normalized cross correlation (docs/algorithms.md, "Similarities").

#include <span>

namespace isoshift {

// Pearson's correlation of two equally long lists of pixels, in [-1, 1]; 0 where either is constant.
double normalized_cross_correlation(std::span<const float> a, std::span<const float> b);

}  // namespace isoshift
