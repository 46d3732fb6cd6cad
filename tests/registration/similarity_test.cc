#include "registration/similarity/similarity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <vector>

namespace isoshift::similarity_test {
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

// Bin n has its middle at n.
const Range kTwoToTheEighth = {.low = 0.0F, .per_unit = 1.0F / 255.0F};

// Values on a raster of thousandths, from 0.001 to 5.
std::vector<float> random_list(std::size_t size, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<float> list(size);
  for (float& value : list) value = 0.001F * static_cast<float>(1 + random() % 5000);
  return list;
}

double rank_correlation_of(const std::vector<float>& xray, const std::vector<float>& drr) {
  return Comparison(SimilarityKind::kStochasticRankCorrelation, xray, {}, range_of(drr)).of(drr);
}

TEST(Similarity, EqualValuesShareTheMeanOfTheirRanks) {
  // Sorted: -2, 1, 1, 5, 5, 5, 9.
  const std::vector<float> values = {5, 1, 9, 5, 1, -2, 5};
  EXPECT_THAT(exact_ranks(values), ElementsAre(4.0F, 1.5F, 6.0F, 4.0F, 1.5F, 0.0F, 4.0F));
  // Each value has a bin of its own: the same.
  EXPECT_EQ(histogram_ranks(values, kTwoToTheEighth), exact_ranks(values));
  const std::vector<float> equal = {7, 7, 7};
  EXPECT_THAT(exact_ranks(equal), ElementsAre(1.0F, 1.0F, 1.0F));
  EXPECT_THAT(histogram_ranks(equal, range_of(equal)), ElementsAre(1.0F, 1.0F, 1.0F));
  EXPECT_TRUE(exact_ranks({}).empty());
  EXPECT_TRUE(histogram_ranks({}, {}).empty());
}

TEST(Similarity, RanksGrowLinearlyBetweenTwoBins) {
  // Shares of 0, 1, 1/2 and 0 in bin 3: a half, one and a half, and again none pixels up to the middles of bins 2 to 4.
  const std::vector<float> values = {2.0F, 3.0F, 3.5F, 9.0F};
  const std::vector<float> ranks = histogram_ranks(values, kTwoToTheEighth);
  EXPECT_NEAR(ranks[0], 0.0F, 1e-6F);                    // 0.5 pixels below the middle of bin 2
  EXPECT_NEAR(ranks[1], 1.25F, 1e-6F);                   // 1 + 1.5 / 2 - 0.5
  EXPECT_NEAR(ranks[2], 0.5F * (1.25F + 2.25F), 1e-6F);  // bin 4 has half a pixel above 2.5
  EXPECT_NEAR(ranks[3], 3.0F, 1e-6F);
}

TEST(Similarity, WhatLiesBeyondTheRangeCountsAsItsEnd) {
  const std::vector<float> values = {-50.0F, 0.0F, 128.0F, 255.0F, 9999.0F};
  EXPECT_THAT(histogram_ranks(values, kTwoToTheEighth), ElementsAre(0.5F, 0.5F, 2.0F, 3.5F, 3.5F));
  const Range range = wide_range_of(values);
  EXPECT_GT(range(-50.0F), 0.0F);
  EXPECT_LT(range(9999.0F), 1.0F);
}

TEST(Similarity, AnExtremePixelDoesNotMoveTheOthersBins) {
  std::vector<float> drr = random_list(2000, 21), xray = random_list(2000, 22);
  for (std::size_t n = 0; n < xray.size(); ++n) xray[n] += drr[n];
  for (const SimilarityKind kind : {SimilarityKind::kStochasticRankCorrelation, SimilarityKind::kMutualInformation,
                                    SimilarityKind::kNormalizedMutualInformation}) {
    const Comparison comparison(kind, xray, {}, wide_range_of(drr));
    const double before = comparison.of(drr);
    std::vector<float> with_extreme = drr;
    with_extreme[7] = 400.0F;
    EXPECT_NEAR(comparison.of(with_extreme), before, 0.005) << to_string(kind);
  }
}

TEST(Similarity, RanksOfEightBitDataAreExact) {
  std::mt19937_64 random(2);
  std::vector<float> values(5000);
  for (float& value : values) value = static_cast<float>(random() % 256);
  EXPECT_EQ(histogram_ranks(values, kTwoToTheEighth), exact_ranks(values));
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

TEST(Similarity, RankCorrelationIsBlindToMonotoneChangesOfTheXray) {
  const std::vector<float> drr = random_list(2000, 4);
  std::vector<float> xray = random_list(2000, 5);
  // On the raster again: values one rounding apart could become equal.
  for (std::size_t n = 0; n < xray.size(); ++n) xray[n] = 0.001F * std::round(1000.0F * (xray[n] + drr[n]));
  const double unchanged = rank_correlation_of(xray, drr);
  EXPECT_NEAR(unchanged, 0.69, 0.03);  // Spearman's rho where Pearson's correlation is sqrt(1/2): near 6/pi asin(r/2)
  for (const double gamma : {0.5, 0.7, 1.0, 1.5, 2.0}) {
    std::vector<float> changed = xray;
    for (float& value : changed) value = static_cast<float>(std::pow(value, gamma));
    EXPECT_EQ(rank_correlation_of(changed, drr), unchanged) << gamma;
    for (float& value : changed) value = -value;
    EXPECT_NEAR(rank_correlation_of(changed, drr), -unchanged, 1e-12) << gamma;
  }
}

double information(SimilarityKind kind, const std::vector<float>& xray, const std::vector<float>& drr) {
  return Comparison(kind, xray, {}, range_of(drr)).of(drr);
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
  const JointHistogram histogram = joint_histogram(bins, drr, range_of(drr));
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

constexpr int kImages =
    3000;  // of 5 x 5 pixels, one after the other: enough that no cell of a histogram is nearly empty

// A DRR that depends on three parameters, smoothly and not only linearly, and an X-ray like it at 0.
struct Parametric {
  std::vector<float> xray = random_list(25 * kImages, 31), first = random_list(25 * kImages, 32),
                     second = random_list(25 * kImages, 33), third = random_list(25 * kImages, 34);

  std::vector<float> drr(const Eigen::Vector3d& p) const {
    std::vector<float> result;
    for (std::size_t n = 0; n < xray.size(); ++n)
      result.push_back(static_cast<float>(xray[n] + 0.4 * third[n] + std::sin(p.x()) * first[n] + p.y() * second[n] +
                                          p.z() * p.x() * third[n] + p.z() * xray[n] * third[n]));
    return result;
  }
  PixelJacobian jacobian(const Eigen::Vector3d& p) const {
    PixelJacobian result(static_cast<Eigen::Index>(xray.size()), 3);
    for (std::size_t n = 0; n < xray.size(); ++n)
      result.row(static_cast<Eigen::Index>(n)) << static_cast<float>(std::cos(p.x()) * first[n] + p.z() * third[n]),
          second[n], static_cast<float>(p.x() * third[n] + xray[n] * third[n]);
    return result;
  }
};

class SimilarityModels : public testing::TestWithParam<SimilarityKind> {
 protected:
  // Of the images' interiors.
  std::vector<Neighbors> neighbors() const {
    std::vector<Neighbors> all;
    for (std::uint32_t image = 0; image < kImages; ++image)
      for (const Neighbors& at : interior())
        all.push_back({25 * image + at.left, 25 * image + at.right, 25 * image + at.above, 25 * image + at.below});
    return all;
  }
  Parametric scene_;
  Comparison comparison_{GetParam(), scene_.xray, neighbors(), wide_range_of(scene_.drr({0, 0, 0}))};
};
INSTANTIATE_TEST_SUITE_P(All, SimilarityModels, testing::ValuesIn(kSimilarityKinds), [](const auto& kind) {
  std::string name(to_string(kind.param));
  std::ranges::replace(name, '-', '_');
  return name;
});

TEST_P(SimilarityModels, HaveTheValueAndTheGradientOfTheSimilarity) {
  const Eigen::Vector3d at(0.04, -0.02, 0.01);
  const QuadraticModel model = comparison_.model(scene_.drr(at), scene_.jacobian(at));
  EXPECT_NEAR(model.value, comparison_.of(scene_.drr(at)), 1e-6);
  // Shares of pixels are whole 256ths: differences over a step in which many pixels cross some.
  const double step = has_histogram(GetParam()) ? 4e-3 : 1e-3;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d along = step * Eigen::Vector3d::Unit(axis);
    const double expected =
        (comparison_.of(scene_.drr(at + along)) - comparison_.of(scene_.drr(at - along))) / (2.0 * step);
    EXPECT_NEAR(model.gradient[axis], expected, 0.03 * std::abs(expected) + 2e-3) << "parameter " << axis;
  }
}

TEST_P(SimilarityModels, BendAsTheSimilarityDoesAtItsTop) {
  if (!has_curvature(GetParam())) {
    EXPECT_EQ(comparison_.model(scene_.drr({0, 0, 0}), scene_.jacobian({0, 0, 0})).curvature.size(), 0);
    return;
  }
  // Against itself: the top lies at the parameters rendered.
  const Eigen::Vector3d top = Eigen::Vector3d::Zero();
  const Comparison with_itself(GetParam(), scene_.drr(top), neighbors(), wide_range_of(scene_.drr(top)));
  const QuadraticModel model = with_itself.model(scene_.drr(top), scene_.jacobian(top));
  const double value = with_itself.of(scene_.drr(top));
  const double step = has_histogram(GetParam()) ? 0.03 : 0.01;
  for (const Eigen::Vector3d& axis :
       {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(1, -1, 0.5)}) {
    const double bend =
        2.0 * value - with_itself.of(scene_.drr(step * axis)) - with_itself.of(scene_.drr(-step * axis));
    EXPECT_NEAR(axis.dot(model.curvature * axis), bend / (step * step), 0.1 * bend / (step * step));
  }
}

}  // namespace
}  // namespace isoshift::similarity_test
