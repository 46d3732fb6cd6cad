#pragma once
// Merit functions: how alike two lists of pixels are (docs/algorithms.md, "Similarities").

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace isoshift {

enum class SimilarityKind {
  kNcc,                  // normalized cross correlation: captures from far
  kGradientCorrelation,  // NCC of the gradients (Penney et al. 1998): precise, blind to slow intensity errors
};

std::string_view to_string(SimilarityKind kind);

// Pearson's correlation of two equally long lists, in [-1, 1]; 0 where either is constant.
double normalized_cross_correlation(std::span<const float> a, std::span<const float> b);

// For one pixel of a list, where its neighbors stand in the same list.
struct Neighbors {
  std::uint32_t left, right, above, below;
};

// The central differences of the pixels that have all neighbors, once along the rows and once along the columns.
struct Gradients {
  std::vector<float> along_row, along_column;
};
Gradients gradients(std::span<const float> pixels, std::span<const Neighbors> neighbors);

// The mean of the correlations along rows and along columns, in [-1, 1].
double gradient_correlation(const Gradients& a, const Gradients& b);

}  // namespace isoshift
