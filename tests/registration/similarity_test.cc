#include "registration/similarity/similarity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace isoshift {
namespace {

TEST(Similarity, CorrelationOfKnownLists) {
  const std::vector<float> a = {1, 2, 3, 4}, b = {2, 1, 4, 3};
  EXPECT_DOUBLE_EQ(normalized_cross_correlation(a, b), 0.6);  // by hand: 3 / 5
  const std::vector<float> scaled = {5, 7, 9, 11}, reversed = {4, 3, 2, 1}, constant = {2, 2, 2, 2};
  EXPECT_DOUBLE_EQ(normalized_cross_correlation(a, scaled), 1.0);
  EXPECT_DOUBLE_EQ(normalized_cross_correlation(a, reversed), -1.0);
  EXPECT_EQ(normalized_cross_correlation(a, constant), 0.0);
}

TEST(Similarity, CorrelationSurvivesALargeOffset) {
  const std::vector<float> a = {10001, 10002, 10003}, b = {1, 2, 4};
  const std::vector<float> centered = {1, 2, 3};
  EXPECT_NEAR(normalized_cross_correlation(a, b), normalized_cross_correlation(centered, b), 1e-12);
}

// A 5 x 5 image row by row, and the neighbors of its 3 x 3 interior.
std::vector<Neighbors> interior() {
  std::vector<Neighbors> neighbors;
  for (std::uint32_t row = 1; row < 4; ++row)
    for (std::uint32_t column = 1; column < 4; ++column) {
      const std::uint32_t n = row * 5 + column;
      neighbors.push_back({n - 1, n + 1, n - 5, n + 5});
    }
  return neighbors;
}

TEST(Similarity, GradientsAreCentralDifferences) {
  std::vector<float> image;
  for (int row = 0; row < 5; ++row)
    for (int column = 0; column < 5; ++column) image.push_back(static_cast<float>(3 * column - 7 * row));
  const Gradients found = gradients(image, interior());
  for (int n = 0; n < 9; ++n) {
    EXPECT_EQ(found.along_row[n], 6.0F);
    EXPECT_EQ(found.along_column[n], -14.0F);
  }
}

TEST(Similarity, GradientCorrelationIgnoresSlowIntensityErrors) {
  std::vector<float> image, shaded;
  for (int row = 0; row < 5; ++row)
    for (int column = 0; column < 5; ++column) {
      image.push_back(std::sin(1.3F * static_cast<float>(column)) + std::cos(2.1F * static_cast<float>(row)));
      shaded.push_back(2.0F * image.back() + 5.0F +
                       0.4F * static_cast<float>(column));  // a ramp is a constant gradient
    }
  EXPECT_NEAR(gradient_correlation(gradients(image, interior()), gradients(shaded, interior())), 1.0, 1e-6);
}

}  // namespace
}  // namespace isoshift
