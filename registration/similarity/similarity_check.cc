#include "registration/similarity/similarity_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "registration/similarity/gl_similarity.h"

namespace isoshift {
namespace {

// Sums of floats in another order than on the CPU leave less than a tenth of it.
constexpr double kMostSimilarityDifference = 1e-4;

constexpr int kTestColumns = 24, kTestRows = 20;
constexpr std::size_t kTestViews = 2, kTestPoses = 2;

// Smooth, with a little noise; alike for neighboring seeds.
std::vector<float> made_up_image(unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0.0F, 0.05F);
  std::vector<float> image;
  for (int row = 0; row < kTestRows; ++row)
    for (int column = 0; column < kTestColumns; ++column)
      image.push_back(3.0F + std::sin(0.5F * static_cast<float>(column) + 0.2F * static_cast<float>(seed)) +
                      std::cos(0.4F * static_cast<float>(row)) + noise(random));
  return image;
}

std::vector<Neighbors> inner_pixels() {
  std::vector<Neighbors> neighbors;
  for (std::uint32_t row = 1; row + 1 < kTestRows; ++row)
    for (std::uint32_t column = 1; column + 1 < kTestColumns; ++column) {
      const std::uint32_t pixel = row * kTestColumns + column;
      neighbors.push_back({pixel - 1, pixel + 1, pixel - kTestColumns, pixel + kTestColumns});
    }
  return neighbors;
}

}  // namespace

SimilarityCheck check_similarities(GlContext& context) {
  context.make_current();
  std::vector<std::vector<float>> drrs;  // [pose][view]
  std::vector<float> all;
  for (unsigned n = 0; n < kTestPoses * kTestViews; ++n) {
    drrs.push_back(made_up_image(10 + n));
    all.insert(all.end(), drrs.back().begin(), drrs.back().end());
  }
  Buffer line_integrals;
  line_integrals.upload(std::as_bytes(std::span(all)));
  SimilarityCheck result;
  for (const SimilarityKind kind : kSimilarityKinds) {
    std::vector<Comparison> comparisons;
    comparisons.reserve(kTestViews);
    for (unsigned view = 0; view < kTestViews; ++view)
      comparisons.emplace_back(kind, made_up_image(view),
                               kind == SimilarityKind::kGradientCorrelation ? inner_pixels() : std::vector<Neighbors>(),
                               wide_range_of(drrs[view]));
    const auto on_gpu = GlSimilarity(context, comparisons).of(line_integrals, kTestPoses);
    for (std::size_t pose = 0; pose < kTestPoses; ++pose)
      for (std::size_t view = 0; view < kTestViews; ++view) {
        const double difference = std::abs(on_gpu[pose][view] - comparisons[view].of(drrs[pose * kTestViews + view]));
        if (!(difference <= kMostSimilarityDifference) && !result.failure)
          result.failure = fmt::format("the similarity {} differs from that of the CPU by {:.2g}, expected at most {}",
                                       to_string(kind), difference, kMostSimilarityDifference);
        if (!(difference <= result.largest)) result.largest = difference;
      }
  }
  return result;
}

}  // namespace isoshift
