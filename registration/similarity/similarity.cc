#include "registration/similarity/similarity.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace isoshift {
namespace {

// The bin of a share of the range: the last one holds the largest value.
int bin_of(float share, int bins) { return std::min(bins - 1, static_cast<int>(share * static_cast<float>(bins))); }

// Entropies of the X-ray, the DRR and both, in nats.
struct Entropies {
  double xray = 0.0, drr = 0.0, joint = 0.0;
};

Entropies entropies_of(const JointHistogram& histogram) {
  std::array<double, kInformationBins> xray = {}, drr = {};
  double sum = 0.0;
  for (std::size_t n = 0; n < histogram.size(); ++n) {
    xray[n / kInformationBins] += histogram[n];
    drr[n % kInformationBins] += histogram[n];
    sum += histogram[n];
  }
  if (!(sum > 0.0)) return {};
  const auto entropy_of = [sum](const auto& counts) {
    double entropy = 0.0;
    for (const double count : counts)
      if (count > 0.0) entropy -= count / sum * std::log(count / sum);
    return entropy;
  };
  return {.xray = entropy_of(xray), .drr = entropy_of(drr), .joint = entropy_of(histogram)};
}

}  // namespace

std::string_view to_string(SimilarityKind kind) {
  switch (kind) {
    case SimilarityKind::kNcc: return "ncc";
    case SimilarityKind::kGradientCorrelation: return "gradient-correlation";
    case SimilarityKind::kStochasticRankCorrelation: return "src";
    case SimilarityKind::kMutualInformation: return "mi";
    case SimilarityKind::kNormalizedMutualInformation: return "nmi";
  }
  return "";
}

std::optional<SimilarityKind> similarity_kind_from(std::string_view name) {
  for (const SimilarityKind kind : kSimilarityKinds)
    if (to_string(kind) == name) return kind;
  return std::nullopt;
}

bool has_curvature(SimilarityKind kind) {
  return kind == SimilarityKind::kNcc || kind == SimilarityKind::kGradientCorrelation ||
         kind == SimilarityKind::kStochasticRankCorrelation;
}

bool has_histogram(SimilarityKind kind) {
  return kind != SimilarityKind::kNcc && kind != SimilarityKind::kGradientCorrelation;
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

std::vector<float> histogram_ranks(std::span<const float> values, const Range& range) {
  return ranked_places(values, range).ranks();
}

std::vector<float> exact_ranks(std::span<const float> values) {
  std::vector<std::uint32_t> order(values.size());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::sort(order, {}, [&](std::uint32_t n) { return values[n]; });
  std::vector<float> ranks(values.size());
  for (std::size_t first = 0, last = 0; first < order.size(); first = last) {
    while (last < order.size() && values[order[last]] == values[order[first]]) ++last;
    for (std::size_t n = first; n < last; ++n) ranks[order[n]] = 0.5F * static_cast<float>(first + last - 1);
  }
  return ranks;
}

double rank_correlation(std::span<const float> ranks_a, std::span<const float> ranks_b) {
  return normalized_cross_correlation(ranks_a, ranks_b);
}

std::vector<std::uint32_t> information_bins(std::span<const float> xray) {
  const Range range = range_of(xray);
  std::vector<std::uint32_t> bins;
  bins.reserve(xray.size());
  for (const float value : xray) bins.push_back(static_cast<std::uint32_t>(bin_of(range(value), kInformationBins)));
  return bins;
}

JointHistogram joint_histogram(std::span<const std::uint32_t> xray_bins, std::span<const float> drr,
                               const Range& range) {
  assert(xray_bins.size() == drr.size());
  JointHistogram histogram = {};
  for (std::size_t n = 0; n < drr.size(); ++n) {
    const Place place = place_of(drr[n], range, kInformationBins);
    const std::size_t at = static_cast<std::size_t>(xray_bins[n]) * kInformationBins + place.lower;
    histogram[at] += kSharesPerPixel - place.shares;
    histogram[at + 1] += place.shares;
  }
  return histogram;
}

double joint_entropy(const JointHistogram& histogram) { return entropies_of(histogram).joint; }

double mutual_information(const JointHistogram& histogram) {
  const Entropies entropies = entropies_of(histogram);
  return entropies.xray + entropies.drr - entropies.joint;
}

double normalized_mutual_information(const JointHistogram& histogram) {
  const Entropies entropies = entropies_of(histogram);
  return entropies.joint > 0.0 ? (entropies.xray + entropies.drr) / entropies.joint : 1.0;
}

Comparison::Comparison(SimilarityKind kind, std::vector<float> xray, std::vector<Neighbors> neighbors,
                       const Range& drr_range)
    : kind_(kind), pixels_(xray.size()), neighbors_(std::move(neighbors)), drr_range_(drr_range) {
  switch (kind) {
    case SimilarityKind::kNcc: values_ = std::move(xray); break;
    case SimilarityKind::kGradientCorrelation: gradients_ = gradients(xray, neighbors_); break;
    // Sorted, once: the result then does not depend on how the receptor's values are spread over their range.
    case SimilarityKind::kStochasticRankCorrelation: values_ = exact_ranks(xray); break;
    case SimilarityKind::kMutualInformation:
    case SimilarityKind::kNormalizedMutualInformation: bins_ = information_bins(xray); break;
  }
}

std::size_t Comparison::pixels_compared() const {
  switch (kind_) {
    case SimilarityKind::kGradientCorrelation: return neighbors_.size();
    case SimilarityKind::kMutualInformation:
    case SimilarityKind::kNormalizedMutualInformation: return bins_.size();
    default: return values_.size();
  }
}

double Comparison::of(std::span<const float> drr) const {
  switch (kind_) {
    case SimilarityKind::kNcc: return normalized_cross_correlation(values_, drr);
    case SimilarityKind::kGradientCorrelation: return gradient_correlation(gradients_, gradients(drr, neighbors_));
    case SimilarityKind::kStochasticRankCorrelation: return rank_correlation(values_, histogram_ranks(drr, drr_range_));
    case SimilarityKind::kMutualInformation: return mutual_information(joint_histogram(bins_, drr, drr_range_));
    case SimilarityKind::kNormalizedMutualInformation:
      return normalized_mutual_information(joint_histogram(bins_, drr, drr_range_));
  }
  return 0.0;
}

}  // namespace isoshift
