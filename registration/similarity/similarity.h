#pragma once
// Merit functions: how alike an X-ray and a DRR are, pixel by pixel of a list (docs/algorithms.md, "Similarities").
//
//   const Comparison comparison(SimilarityKind::kStochasticRankCorrelation, xray_pixels);
//   const double similarity = comparison.of(drr_pixels);
//
// GlSimilarity computes the same on a GPU (similarity.comp).

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "registration/quadratic_model.h"
#include "registration/similarity/histogram.h"

namespace isoshift {

enum class SimilarityKind {
  kNcc,                         // normalized cross correlation, -1 to 1
  kGradientCorrelation,         // NCC of the gradients (Penney et al. 1998), -1 to 1: precise, captures little
  kStochasticRankCorrelation,   // SRC, Spearman's rho (Birkfellner et al. 2009), -1 to 1: blind to monotone changes
  kMutualInformation,           // in nats, 0 and more
  kNormalizedMutualInformation  // (H(A) + H(B)) / H(A, B) (Studholme et al. 1999), 1 to 2
};

inline constexpr std::array kSimilarityKinds = {
    SimilarityKind::kNcc, SimilarityKind::kGradientCorrelation, SimilarityKind::kStochasticRankCorrelation,
    SimilarityKind::kMutualInformation, SimilarityKind::kNormalizedMutualInformation};

std::string_view to_string(SimilarityKind kind);
std::optional<SimilarityKind> similarity_kind_from(std::string_view name);

// Correlations are least squares, which bend as Gauss-Newton says; of mutual information only the gradient is known.
bool has_curvature(SimilarityKind kind);

// Those that need a range of the DRR's values.
bool has_histogram(SimilarityKind kind);

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

// Ranks from a cumulative histogram of kRankBins bins: between the middles of two bins, ranks grow linearly (0 is the
// first). Exact for 8-bit data.
std::vector<float> histogram_ranks(std::span<const float> values, const Range& range);

// The same with one bin per value: what a sort gives.
std::vector<float> exact_ranks(std::span<const float> values);

// Spearman's rho as Pearson's correlation of mid-ranks, which holds with ties, too.
double rank_correlation(std::span<const float> ranks_a, std::span<const float> ranks_b);

// Joint histogram of kInformationBins x kInformationBins. An X-ray pixel falls into one bin of the X-ray's own range.
inline constexpr int kInformationBins = 32;
using JointHistogram = std::array<std::uint32_t, static_cast<std::size_t>(kInformationBins) * kInformationBins>;
std::vector<std::uint32_t> information_bins(std::span<const float> xray);
JointHistogram joint_histogram(std::span<const std::uint32_t> xray_bins, std::span<const float> drr,
                               const Range& range);
double joint_entropy(const JointHistogram& histogram);                  // nats
double mutual_information(const JointHistogram& histogram);             // nats
double normalized_mutual_information(const JointHistogram& histogram);  // 1 where nothing is shared

// How the pixels of a DRR change with some parameters: a row per pixel, a column per parameter.
using PixelJacobian = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// How gradients() of the pixels change, a row per pixel that has all neighbors.
struct GradientJacobians {
  PixelJacobian along_row, along_column;
};
GradientJacobians gradient_jacobians(const Eigen::Ref<const PixelJacobian>& jacobian,
                                     std::span<const Neighbors> neighbors);

// The X-ray's side of one view, prepared once.
class Comparison {
 public:
  // `neighbors` are those of the pixels compared, for gradients; else every pixel of the list is compared. `drr_range`
  // is that of the histograms of DRRs, for kinds that have them.
  Comparison(SimilarityKind kind, std::vector<float> xray, std::vector<Neighbors> neighbors = {},
             const Range& drr_range = {});

  // How alike a DRR's pixels are, in the order of the X-ray's.
  double of(std::span<const float> drr) const;

  // The same as a model of parameters on which the DRR's pixels depend. The curvature is that of Gauss-Newton, for
  // kinds with has_curvature() (docs/algorithms.md, "Derivatives").
  QuadraticModel model(std::span<const float> drr, const Eigen::Ref<const PixelJacobian>& jacobian) const;

  SimilarityKind kind() const { return kind_; }
  std::size_t pixels() const { return pixels_; }  // of a DRR
  std::size_t pixels_compared() const;
  // What the kind needs of the X-ray: line integrals, ranks or (as numbers) bins; or gradients and neighbors.
  std::span<const float> values() const { return values_; }
  std::span<const std::uint32_t> bins() const { return bins_; }
  const Gradients& xray_gradients() const { return gradients_; }
  std::span<const Neighbors> neighbors() const { return neighbors_; }
  const Range& drr_range() const { return drr_range_; }

 private:
  SimilarityKind kind_;
  std::size_t pixels_;
  std::vector<float> values_;
  std::vector<std::uint32_t> bins_;
  std::vector<Neighbors> neighbors_;
  Gradients gradients_;
  Range drr_range_;
};

}  // namespace isoshift
