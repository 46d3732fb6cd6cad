#include "registration/optimizer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "tests/support/batched.h"

namespace isoshift::optimizer_test {
namespace {

OptimizerOptions two_parameters(OptimizerKind kind = OptimizerKind::kBobyqa) {
  return {.kind = kind,
          .start = {0, 0},
          .lower = {-10, -10},
          .upper = {10, 10},
          .initial_step = {1, 1},
          .relative_tolerance = 1e-6};
}

double parabola(const std::vector<double>& x) { return -(x[0] - 3) * (x[0] - 3) - 2 * (x[1] + 1.5) * (x[1] + 1.5) + 7; }

OptimizerResult maximize_alone(const BatchObjective& objective, const OptimizerOptions& options) {
  return maximize(objective, std::span(&options, 1)).front();
}

class EveryOptimizer : public testing::TestWithParam<OptimizerKind> {};
INSTANTIATE_TEST_SUITE_P(All, EveryOptimizer,
                         testing::Values(OptimizerKind::kBobyqa, OptimizerKind::kNelderMead, OptimizerKind::kSbplx,
                                         OptimizerKind::kNewuoa, OptimizerKind::kLbfgs),
                         [](const auto& kind) {
                           std::string name(to_string(kind.param));
                           std::erase(name, '-');
                           return name;
                         });

TEST_P(EveryOptimizer, FindsTheTopOfAParabola) {
  const auto result = maximize_alone(batched(parabola), two_parameters(GetParam()));
  EXPECT_NEAR(result.best[0], 3.0, 1e-3);
  EXPECT_NEAR(result.best[1], -1.5, 1e-3);
  EXPECT_NEAR(result.value, 7.0, 1e-6);
  EXPECT_GT(result.evaluations, 0);
}

TEST_P(EveryOptimizer, StaysInTheBox) {
  const auto result = maximize_alone(batched([](auto x) { return x[0] + x[1]; }), two_parameters(GetParam()));
  EXPECT_NEAR(result.best[0], 10.0, 1e-4);
  EXPECT_NEAR(result.best[1], 10.0, 1e-4);
}

TEST_P(EveryOptimizer, LetsTheObjectivesExceptionsThrough) {
  try {
    maximize_alone(batched([](auto) -> double { throw Error("no DRR"); }), two_parameters(GetParam()));
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "no DRR");
  }
}

TEST_P(EveryOptimizer, SearchesInStepFindWhatEachFindsAlone) {
  std::vector<OptimizerOptions> searches(3, two_parameters(GetParam()));
  searches[1].start = {4, -6};
  searches[2].start = {-7, 2};
  searches[2].relative_tolerance = 0.05;  // ends before the others
  const auto wavy = batched([](const std::vector<double>& x) { return parabola(x) + std::cos(x[0]) * std::sin(x[1]); });
  std::size_t largest_batch = 0;
  const auto counted = [&](std::span<const std::vector<double>> points) {
    largest_batch = std::max(largest_batch, points.size());
    return wavy(points);
  };
  const std::vector<OptimizerResult> together = maximize(counted, searches);
  EXPECT_EQ(largest_batch, GetParam() == OptimizerKind::kLbfgs ? 15U : 3U);
  for (std::size_t n = 0; n < searches.size(); ++n) {
    const OptimizerResult alone = maximize_alone(wavy, searches[n]);
    EXPECT_EQ(together[n].best, alone.best);
    EXPECT_EQ(together[n].evaluations, alone.evaluations);
  }
}

TEST(Optimizer, AnExceptionEndsAllSearchesInStep) {
  const std::vector<OptimizerOptions> searches(3, two_parameters());
  int calls = 0;
  const auto failing = [&](std::span<const std::vector<double>> points) {
    if (++calls == 5) throw Error("no DRR");
    return batched(parabola)(points);
  };
  EXPECT_THROW(maximize(failing, searches), Error);
}

TEST(Optimizer, LbfgsAsksForWholeGradientsAtOnce) {
  std::vector<std::size_t> batches;
  const auto counted = [&](std::span<const std::vector<double>> points) {
    batches.push_back(points.size());
    return batched(parabola)(points);
  };
  maximize_alone(counted, two_parameters(OptimizerKind::kLbfgs));
  EXPECT_THAT(batches, testing::Each(5U));  // the point and two differences along each of two axes
}

TEST(Optimizer, SaysWhenTheEvaluationsRanOut) {
  OptimizerOptions options = two_parameters();
  options.max_evaluations = 7;
  const auto result = maximize_alone(batched([](auto x) { return -x[0] * x[0] * x[0] * x[0] - x[1]; }), options);
  EXPECT_EQ(result.evaluations, 7);
  EXPECT_EQ(result.termination, "evaluation limit reached");
}

}  // namespace
}  // namespace isoshift::optimizer_test
