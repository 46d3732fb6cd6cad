// Models of similarities: how they change with parameters on which the DRR depends (docs/algorithms.md, "Derivatives").

#include <cmath>

#include "registration/similarity/correlation_model.h"
#include "registration/similarity/similarity.h"

namespace isoshift {
namespace {

using Eigen::Index;
using JacobianRef = Eigen::Ref<const PixelJacobian>;

// Pearson's correlation of an X-ray's values with a DRR's, whose derivatives are the rows of `jacobian`.
QuadraticModel correlation_of(std::span<const float> xray, std::span<const float> drr, const JacobianRef& jacobian) {
  const auto centered = [](std::span<const float> values) {
    Eigen::VectorXd result =
        Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Index>(values.size())).cast<double>();
    result.array() -= result.mean();
    return result;
  };
  Eigen::MatrixXd of_drr = jacobian.cast<double>();
  of_drr.rowwise() -= of_drr.colwise().mean().eval();
  return correlation_model(centered(xray), centered(drr), std::move(of_drr));
}

// How histogram_ranks() change. A pixel that moves among the bins changes its own rank, and takes others with it: by
// moving a share from bin b to the next it lowers the ranks at the middles of both by half of that.
PixelJacobian jacobian_of_ranks(const RankedPlaces& ranked, std::span<const float> drr, const Range& range,
                                const JacobianRef& jacobian) {
  PixelJacobian moved = PixelJacobian::Zero(kRankBins, jacobian.cols());  // shares, from each bin to the next
  PixelJacobian result = jacobian;
  for (std::size_t n = 0; n < drr.size(); ++n) {
    auto row = result.row(static_cast<Index>(n));
    row *= bins_per_unit(drr[n], range, kRankBins);
    moved.row(static_cast<Index>(ranked.places[n].lower)) += row;
  }
  PixelJacobian of_middles = -0.5F * moved;
  of_middles.bottomRows(kRankBins - 1) -= 0.5F * moved.topRows(kRankBins - 1);
  for (std::size_t n = 0; n < drr.size(); ++n) {
    const Place& place = ranked.places[n];
    const auto lower = static_cast<Index>(place.lower);
    auto row = result.row(static_cast<Index>(n));
    row *= ranked.of_middles[place.lower + 1] - ranked.of_middles[place.lower];
    row += (1.0F - place.beyond) * of_middles.row(lower) + place.beyond * of_middles.row(lower + 1);
  }
  return result;
}

// How entropies change with a pixel that moves a share from DRR bin `lower` to the next, per share of one pixel.
class EntropyChanges {
 public:
  explicit EntropyChanges(const JointHistogram& histogram) : joint_(histogram) {
    for (std::size_t n = 0; n < histogram.size(); ++n) drr_[n % kInformationBins] += histogram[n];
    for (const std::uint32_t count : drr_) sum_ += count;
  }
  double pixels() const { return sum_ / kSharesPerPixel; }
  double of_drr(std::size_t lower) const { return log_ratio(drr_[lower], drr_[lower + 1]); }
  double of_both(std::uint32_t xray_bin, std::size_t lower) const {
    const std::size_t at = static_cast<std::size_t>(xray_bin) * kInformationBins + lower;
    return log_ratio(joint_[at], joint_[at + 1]);
  }

 private:
  // An empty bin has no logarithm: it counts as one share.
  double log_ratio(std::uint32_t from, std::uint32_t to) const {
    return (std::log(std::max(1U, from)) - std::log(std::max(1U, to))) / pixels();
  }
  const JointHistogram& joint_;
  std::array<std::uint32_t, kInformationBins> drr_ = {};
  double sum_ = 0.0;
};

// Mutual information, of which only the gradient is known: d H(B) and d H(A, B), each -sum log p dp.
QuadraticModel information_model(SimilarityKind kind, std::span<const std::uint32_t> xray_bins,
                                 std::span<const float> drr, const Range& range, const JacobianRef& jacobian) {
  const JointHistogram histogram = joint_histogram(xray_bins, drr, range);
  const EntropyChanges changes(histogram);
  const bool is_normalized = kind == SimilarityKind::kNormalizedMutualInformation;
  const double value = is_normalized ? normalized_mutual_information(histogram) : mutual_information(histogram);
  QuadraticModel model{.value = value, .gradient = Eigen::VectorXd::Zero(jacobian.cols()), .curvature = {}};
  if (drr.empty()) return model;
  const double joint = joint_entropy(histogram);
  for (std::size_t n = 0; n < drr.size(); ++n) {
    const double bins = bins_per_unit(drr[n], range, kInformationBins);
    const std::size_t lower = place_of(drr[n], range, kInformationBins).lower;
    const double of_drr = changes.of_drr(lower), of_both = changes.of_both(xray_bins[n], lower);
    double per_bin = of_drr - of_both;
    if (is_normalized) per_bin = joint > 0.0 ? (of_drr - value * of_both) / joint : 0.0;  // of (H(A) + H(B)) / H(A, B)
    model.gradient += per_bin * bins * jacobian.row(static_cast<Index>(n)).transpose().cast<double>();
  }
  return model;
}

}  // namespace

GradientJacobians gradient_jacobians(const JacobianRef& jacobian, std::span<const Neighbors> neighbors) {
  const auto count = static_cast<Index>(neighbors.size());
  GradientJacobians result{.along_row = PixelJacobian(count, jacobian.cols()),
                           .along_column = PixelJacobian(count, jacobian.cols())};
  for (Index n = 0; n < count; ++n) {
    const Neighbors& around = neighbors[static_cast<std::size_t>(n)];
    result.along_row.row(n) = jacobian.row(around.right) - jacobian.row(around.left);
    result.along_column.row(n) = jacobian.row(around.below) - jacobian.row(around.above);
  }
  return result;
}

QuadraticModel Comparison::model(std::span<const float> drr, const Eigen::Ref<const PixelJacobian>& jacobian) const {
  switch (kind_) {
    case SimilarityKind::kNcc: return correlation_of(values_, drr, jacobian);
    case SimilarityKind::kGradientCorrelation: {
      const Gradients of_drr = gradients(drr, neighbors_);
      const GradientJacobians change = gradient_jacobians(jacobian, neighbors_);
      return weighted_sum(0.5, correlation_of(gradients_.along_row, of_drr.along_row, change.along_row), 0.5,
                          correlation_of(gradients_.along_column, of_drr.along_column, change.along_column));
    }
    case SimilarityKind::kStochasticRankCorrelation: {
      const RankedPlaces ranked = ranked_places(drr, drr_range_);
      return correlation_of(values_, ranked.ranks(), jacobian_of_ranks(ranked, drr, drr_range_, jacobian));
    }
    case SimilarityKind::kMutualInformation:
    case SimilarityKind::kNormalizedMutualInformation:
      return information_model(kind_, bins_, drr, drr_range_, jacobian);
  }
  return {};
}

}  // namespace isoshift
