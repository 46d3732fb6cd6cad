#include "registration/similarity/similarity_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "registration/objective.h"
#include "registration/similarity/gl_similarity.h"

namespace isoshift {
namespace {

// Sums of floats in another order than on the CPU leave less than a tenth of it.
constexpr double kMostSimilarityDifference = 1e-4, kMostModelDifference = 1e-3;

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

// How the pixels of an image change with six motions: six other images, about 0.
std::vector<MotionDerivatives> made_up_derivatives(unsigned seed) {
  std::vector<MotionDerivatives> derivatives(static_cast<std::size_t>(kTestColumns) * kTestRows);
  for (int motion = 0; motion < 6; ++motion) {
    const std::vector<float> image = made_up_image(100 + 7 * seed + static_cast<unsigned>(motion));
    for (std::size_t n = 0; n < image.size(); ++n) derivatives[n][motion] = image[n] - 3.0F;
  }
  return derivatives;
}

double relative_difference(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
  return (found - expected).norm() / expected.norm();
}

}  // namespace

SimilarityCheck check_similarities(GlContext& context) {
  context.make_current();
  std::vector<std::vector<float>> drrs;  // [pose][view]
  std::vector<std::vector<MotionDerivatives>> slopes;
  std::vector<float> all;
  std::vector<MotionDerivatives> all_slopes;
  for (unsigned n = 0; n < kTestPoses * kTestViews; ++n) {
    drrs.push_back(made_up_image(10 + n));
    all.insert(all.end(), drrs.back().begin(), drrs.back().end());
    slopes.push_back(made_up_derivatives(n));
    all_slopes.insert(all_slopes.end(), slopes.back().begin(), slopes.back().end());
  }
  Buffer line_integrals, derivatives;
  line_integrals.upload(std::as_bytes(std::span(all)));
  derivatives.upload(std::as_bytes(std::span(all_slopes)));
  SimilarityCheck result;
  const auto require = [&](double difference, double most, const char* what, SimilarityKind kind) {
    if (!(difference <= most) && !result.failure)
      result.failure = fmt::format("{} {} differs from that of the CPU by {:.2g}, expected at most {}", what,
                                   to_string(kind), difference, most);
  };
  for (const SimilarityKind kind : kSimilarityKinds) {
    std::vector<Comparison> comparisons;
    comparisons.reserve(kTestViews);
    for (unsigned view = 0; view < kTestViews; ++view)
      comparisons.emplace_back(kind, made_up_image(view),
                               kind == SimilarityKind::kGradientCorrelation ? inner_pixels() : std::vector<Neighbors>(),
                               wide_range_of(drrs[view]));
    GlSimilarity on_gpu(context, comparisons);
    const auto found = on_gpu.of(line_integrals, kTestPoses);
    const auto models =
        has_curvature(kind) ? on_gpu.models(line_integrals, derivatives, kTestPoses) : std::vector<QuadraticModel>();
    for (std::size_t pose = 0; pose < kTestPoses; ++pose)
      for (std::size_t view = 0; view < kTestViews; ++view) {
        const std::size_t n = pose * kTestViews + view;
        const double difference = std::abs(found[pose][view] - comparisons[view].of(drrs[n]));
        require(difference, kMostSimilarityDifference, "the similarity", kind);
        if (!(difference <= result.largest)) result.largest = difference;
        if (models.empty()) continue;
        const QuadraticModel expected = comparisons[view].model(drrs[n], pixel_jacobian(slopes[n]));
        const double of_model = std::max({std::abs(models[n].value - expected.value),
                                          relative_difference(models[n].gradient, expected.gradient),
                                          relative_difference(models[n].curvature, expected.curvature)});
        require(of_model, kMostModelDifference, "the model of", kind);
        if (!(of_model <= result.models)) result.models = of_model;
      }
  }
  return result;
}

}  // namespace isoshift
