#include "registration/optimizer.h"

#include <gtest/gtest.h>

#include "geometry/error.h"

namespace isoshift {
namespace {

OptimizerOptions two_parameters() {
  return {.start = {0, 0}, .lower = {-10, -10}, .upper = {10, 10}, .initial_step = {1, 1}, .relative_tolerance = 1e-6};
}

TEST(Optimizer, FindsTheTopOfAParabola) {
  const auto result =
      maximize([](auto x) { return -(x[0] - 3) * (x[0] - 3) - 2 * (x[1] + 1.5) * (x[1] + 1.5) + 7; }, two_parameters());
  EXPECT_NEAR(result.best[0], 3.0, 1e-4);
  EXPECT_NEAR(result.best[1], -1.5, 1e-4);
  EXPECT_NEAR(result.value, 7.0, 1e-7);
  EXPECT_GT(result.evaluations, 0);
}

TEST(Optimizer, StaysInTheBox) {
  const auto result = maximize([](auto x) { return x[0] + x[1]; }, two_parameters());
  EXPECT_DOUBLE_EQ(result.best[0], 10.0);
  EXPECT_DOUBLE_EQ(result.best[1], 10.0);
}

TEST(Optimizer, SaysWhenTheEvaluationsRanOut) {
  OptimizerOptions options = two_parameters();
  options.max_evaluations = 7;
  const auto result = maximize([](auto x) { return -x[0] * x[0] * x[0] * x[0] - x[1]; }, options);
  EXPECT_EQ(result.evaluations, 7);
  EXPECT_EQ(result.termination, "evaluation limit reached");
}

TEST(Optimizer, LetsTheObjectivesExceptionsThrough) {
  try {
    maximize([](auto) -> double { throw Error("no DRR"); }, two_parameters());
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "no DRR");
  }
}

}  // namespace
}  // namespace isoshift
