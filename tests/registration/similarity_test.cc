#include "registration/similarity/similarity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

namespace isoshift {
namespace {

using testing::ElementsAre;

TEST(Similarity, NamesLeadBackToTheirKinds) {
  for (const SimilarityKind kind : kSimilarityKinds) EXPECT_EQ(similarity_kind_from(to_string(kind)), kind);
  EXPECT_EQ(similarity_kind_from("src"), SimilarityKind::kStochasticRankCorrelation);
  EXPECT_EQ(similarity_kind_from("NCC"), std::nullopt);
  EXPECT_EQ(similarity_kind_from(""), std::nullopt);
}

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

TEST(Similarity, EqualValuesShareTheMeanOfTheirRanks) {
  // Sorted: -2, 1, 1, 5, 5, 5, 9.
  const std::vector<float> values = {5, 1, 9, 5, 1, -2, 5};
  EXPECT_THAT(exact_ranks(values), ElementsAre(4.0F, 1.5F, 6.0F, 4.0F, 1.5F, 0.0F, 4.0F));
  // Each value has a bin of its own: the same.
  EXPECT_EQ(histogram_ranks(values), exact_ranks(values));
  EXPECT_THAT(exact_ranks(std::vector<float>{7, 7, 7}), ElementsAre(1.0F, 1.0F, 1.0F));
  EXPECT_THAT(histogram_ranks(std::vector<float>{7, 7, 7}), ElementsAre(1.0F, 1.0F, 1.0F));
  EXPECT_TRUE(exact_ranks({}).empty());
  EXPECT_TRUE(histogram_ranks({}).empty());
}

TEST(Similarity, ValuesOfOneBinAreTies) {
  const std::vector<float> values = {0.0F, 0.003F, 0.004F, 1.0F};  // bins are 1/256 wide: 0.0039
  EXPECT_THAT(histogram_ranks(values), ElementsAre(0.5F, 0.5F, 2.0F, 3.0F));
  EXPECT_THAT(exact_ranks(values), ElementsAre(0.0F, 1.0F, 2.0F, 3.0F));
}

TEST(Similarity, RanksOfEightBitDataAreExact) {
  std::mt19937_64 random(2);
  std::vector<float> values(5000);
  for (float& value : values) value = static_cast<float>(random() % 256);
  EXPECT_EQ(histogram_ranks(values), exact_ranks(values));
}

TEST(Similarity, RankCorrelationIsSpearmansRhoWithoutTies) {
  // By hand: d = -1, 1, -2, 0, 2; rho = 1 - 6 * 10 / (5 * 24) = 0.5.
  const std::vector<float> a = {0, 1, 2, 3, 4}, b = {1, 0, 4, 3, 2};
  EXPECT_NEAR(rank_correlation(a, b), 0.5, 1e-12);

  std::vector<float> first(200), second(200);
  std::iota(first.begin(), first.end(), 0.0F);
  std::iota(second.begin(), second.end(), 0.0F);
  std::mt19937_64 random(3);
  std::ranges::shuffle(second, random);
  double squares = 0.0;
  for (std::size_t n = 0; n < first.size(); ++n) squares += std::pow(first[n] - second[n], 2);
  EXPECT_NEAR(rank_correlation(exact_ranks(first), exact_ranks(second)), 1.0 - 6.0 * squares / (200.0 * 39999.0),
              1e-12);
}

TEST(Similarity, RankCorrelationWithTies) {
  // Ranks 0.5 0.5 2 3 and 0 1 2.5 2.5: deviations -1 -1 .5 1.5 and -1.5 -.5 1 1, so 4 / sqrt(4.5 * 4.5) by hand.
  const auto a = exact_ranks(std::vector<float>{1, 1, 2, 3}), b = exact_ranks(std::vector<float>{1, 2, 3, 3});
  EXPECT_NEAR(rank_correlation(a, b), 4.0 / 4.5, 1e-12);
}

// Values on a raster of thousandths, from 0.001 to 5.
std::vector<float> random_list(std::size_t size, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<float> list(size);
  for (float& value : list) value = 0.001F * static_cast<float>(1 + random() % 5000);
  return list;
}

TEST(Similarity, RankCorrelationIsBlindToMonotoneChangesOfTheXray) {
  const std::vector<float> drr = random_list(2000, 4);
  std::vector<float> xray = random_list(2000, 5);
  // On the raster again: values one rounding apart could become equal.
  for (std::size_t n = 0; n < xray.size(); ++n) xray[n] = 0.001F * std::round(1000.0F * (xray[n] + drr[n]));
  const double unchanged = Comparison(SimilarityKind::kStochasticRankCorrelation, xray).of(drr);
  EXPECT_NEAR(unchanged, 0.69, 0.03);  // Spearman's rho where Pearson's correlation is sqrt(1/2): near 6/pi asin(r/2)
  for (const double gamma : {0.5, 0.7, 1.0, 1.5, 2.0}) {
    std::vector<float> changed = xray;
    for (float& value : changed) value = static_cast<float>(std::pow(value, gamma));
    EXPECT_EQ(Comparison(SimilarityKind::kStochasticRankCorrelation, changed).of(drr), unchanged) << gamma;
    for (float& value : changed) value = -value;
    EXPECT_NEAR(Comparison(SimilarityKind::kStochasticRankCorrelation, changed).of(drr), -unchanged, 1e-12) << gamma;
  }
}

double information(SimilarityKind kind, const std::vector<float>& xray, const std::vector<float>& drr) {
  return Comparison(kind, xray).of(drr);
}

TEST(Similarity, InformationOfIndependentAndOfIdenticalLists) {
  // Every pair of 32 levels once: nothing in common. Every level alike: all of ln 32 nats.
  std::vector<float> high, low, levels;
  for (int pair = 0; pair < 32 * 32; ++pair) {
    high.push_back(static_cast<float>(pair / 32));
    low.push_back(static_cast<float>(pair % 32));
  }
  EXPECT_NEAR(information(SimilarityKind::kMutualInformation, high, low), 0.0, 1e-12);
  EXPECT_NEAR(information(SimilarityKind::kNormalizedMutualInformation, high, low), 1.0, 1e-12);
  EXPECT_NEAR(information(SimilarityKind::kMutualInformation, low, low), std::log(32.0), 1e-12);
  EXPECT_NEAR(information(SimilarityKind::kNormalizedMutualInformation, low, low), 2.0, 1e-12);
}

TEST(Similarity, InformationOfTwoLevels) {
  // 1/4 of the pixels differ: ln 2 minus the entropy of 1/4 and 3/4.
  const std::vector<float> a = {0, 0, 0, 0, 1, 1, 1, 1}, b = {0, 0, 0, 1, 1, 1, 1, 0};
  const double expected = std::log(2.0) + 0.25 * std::log(0.25) + 0.75 * std::log(0.75);
  EXPECT_NEAR(information(SimilarityKind::kMutualInformation, a, b), expected, 1e-12);
  EXPECT_NEAR(information(SimilarityKind::kNormalizedMutualInformation, a, b),
              2.0 * std::log(2.0) / (2.0 * std::log(2.0) - expected), 1e-12);
}

TEST(Similarity, InformationStaysWithinItsBounds) {
  const std::vector<float> xray = random_list(3000, 6), noise = random_list(3000, 7);
  const std::vector<float> constant(3000, 2.0F);
  for (const float share : {0.0F, 0.1F, 0.5F, 1.0F}) {
    std::vector<float> drr = xray;
    for (std::size_t n = 0; n < drr.size(); ++n) drr[n] += share * (noise[n] - xray[n]);
    const double mi = information(SimilarityKind::kMutualInformation, xray, drr);
    const double nmi = information(SimilarityKind::kNormalizedMutualInformation, xray, drr);
    EXPECT_GT(mi, 0.0);
    EXPECT_LT(mi, std::log(32.0));
    EXPECT_GT(nmi, 1.0);
    EXPECT_LT(nmi, 2.0);
  }
  EXPECT_NEAR(information(SimilarityKind::kMutualInformation, xray, constant), 0.0, 1e-12);
  EXPECT_NEAR(information(SimilarityKind::kNormalizedMutualInformation, xray, constant), 1.0, 1e-12);
  EXPECT_EQ(information(SimilarityKind::kNormalizedMutualInformation, constant, constant), 1.0);
}

TEST(Similarity, ValuesBetweenTwoBinsAreSharedByDistance) {
  const std::vector<std::uint32_t> bins = {0, 0, 3, 0};
  const std::vector<float> drr = {0.0F, 31.0F, 4.25F, 4.25F};
  const JointHistogram histogram = joint_histogram(bins, drr);
  EXPECT_EQ(histogram[0], 256U);
  EXPECT_EQ(histogram[31], 256U);
  EXPECT_EQ(histogram[4], 192U);
  EXPECT_EQ(histogram[5], 64U);
  EXPECT_EQ(histogram[3 * 32 + 4], 192U);
  EXPECT_EQ(histogram[3 * 32 + 5], 64U);
  EXPECT_EQ(std::accumulate(histogram.begin(), histogram.end(), 0U), 4U * 256U);
}

TEST(Similarity, InformationChangesSmoothlyWithTheDrr) {
  // A DRR that turns into another one in 200 steps: no step changes much more than the steps beside it, as whole pixels
  // that change bins would.
  const std::vector<float> xray = random_list(500, 8);
  std::vector<float> from = xray, to = xray;
  for (std::size_t n = 0; n < xray.size(); ++n) to[n] = 0.5F * xray[n] * xray[n];
  std::vector<double> along;
  for (int step = 0; step <= 200; ++step) {
    std::vector<float> drr(xray.size());
    for (std::size_t n = 0; n < drr.size(); ++n)
      drr[n] = from[n] + static_cast<float>(step) / 200.0F * (to[n] - from[n]);
    along.push_back(information(SimilarityKind::kMutualInformation, xray, drr));
  }
  for (std::size_t n = 1; n + 1 < along.size(); ++n)
    EXPECT_NEAR(along[n], 0.5 * (along[n - 1] + along[n + 1]), 0.01) << "step " << n;
}

}  // namespace
}  // namespace isoshift
