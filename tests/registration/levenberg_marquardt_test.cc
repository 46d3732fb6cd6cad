#include "registration/levenberg_marquardt.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "tests/support/batched.h"

namespace isoshift::levenberg_marquardt_test {
namespace {

OptimizerOptions from(std::vector<double> start) {
  return {.kind = OptimizerKind::kLevenbergMarquardt,
          .start = std::move(start),
          .lower = {-10, -10},
          .upper = {10, 10},
          .initial_step = {1, 1},
          .relative_tolerance = 1e-6};
}

// Half of the squares of two residuals, which are no straight lines, as a least-squares model: -|r|^2 / 2.
QuadraticModel rosenbrock(const std::vector<double>& x) {
  const Eigen::Vector2d residual(10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]);
  Eigen::Matrix2d jacobian;
  jacobian << -20.0 * x[0], 10.0, -1.0, 0.0;
  return {.value = -0.5 * residual.squaredNorm(),
          .gradient = -jacobian.transpose() * residual,
          .curvature = jacobian.transpose() * jacobian};
}

OptimizerResult climb_alone(const BatchModel& models, const OptimizerOptions& options) {
  return climb(models, std::span(&options, 1)).front();
}

TEST(LevenbergMarquardt, FollowsACurvedValleyToItsEnd) {
  const OptimizerResult result = climb_alone(batched(rosenbrock), from({-1.2, 1.0}));
  EXPECT_NEAR(result.best[0], 1.0, 1e-5);
  EXPECT_NEAR(result.best[1], 1.0, 1e-5);
  EXPECT_NEAR(result.value, 0.0, 1e-9);
  EXPECT_EQ(result.termination, "step tolerance reached");
  EXPECT_LT(result.evaluations, 60);
}

// -ln(1 + |r|^2), with the curvature that its weights have: where residuals are large it is too large by far.
TEST(LevenbergMarquardt, TakesLongerStepsWhereTheyGainMoreThanTheyPromise) {
  const auto robust = [](const std::vector<double>& x) {
    const Eigen::Vector2d residual(x[0] - 3.0, 2.0 * (x[1] + 4.0));
    const Eigen::Vector2d slopes(1.0, 2.0);
    const double weight = 2.0 / (1.0 + residual.squaredNorm());
    return QuadraticModel{.value = -std::log1p(residual.squaredNorm()),
                          .gradient = -weight * slopes.cwiseProduct(residual),
                          .curvature = Eigen::Vector2d(8.0 * weight * slopes.cwiseAbs2()).asDiagonal()};
  };
  const OptimizerResult result = climb_alone(batched(robust), from({-6.0, 6.0}));
  EXPECT_NEAR(result.best[0], 3.0, 1e-3);
  EXPECT_NEAR(result.best[1], -4.0, 1e-3);
  EXPECT_LT(result.evaluations, 40);  // 109 with all of the curvature
}

TEST(LevenbergMarquardt, StaysInTheBox) {
  OptimizerOptions options = from({-1.2, 1.0});
  options.upper = {0.5, 10.0};
  const OptimizerResult result = climb_alone(batched(rosenbrock), options);
  EXPECT_NEAR(result.best[0], 0.5, 1e-6);
  EXPECT_NEAR(result.best[1], 0.25, 0.01);
}

TEST(LevenbergMarquardt, SaysThatItReachedTheLimit) {
  OptimizerOptions options = from({-1.2, 1.0});
  options.max_evaluations = 3;
  const OptimizerResult result = climb_alone(batched(rosenbrock), options);
  EXPECT_TRUE(result.reached_limit);
  EXPECT_EQ(result.evaluations, 3);
}

TEST(LevenbergMarquardt, KeepsTheBestPointOfAModelThatMisleads) {
  // The model promises more than there is, far away and everywhere: the value is a parabola, the curvature a hundredth.
  const auto misleading = [](const std::vector<double>& x) {
    const Eigen::Vector2d at(x[0] - 2.0, x[1] + 1.0);
    return QuadraticModel{
        .value = -0.5 * at.squaredNorm(), .gradient = -at, .curvature = 0.01 * Eigen::Matrix2d::Identity()};
  };
  const OptimizerResult result = climb_alone(batched(misleading), from({0.0, 0.0}));
  EXPECT_NEAR(result.best[0], 2.0, 1e-3);
  EXPECT_NEAR(result.best[1], -1.0, 1e-3);
}

TEST(LevenbergMarquardt, EndsWhereNothingIsToBeGained) {
  const auto flat = [](const std::vector<double>&) {
    return QuadraticModel{.value = 3.0, .gradient = Eigen::Vector2d::Zero(), .curvature = Eigen::Matrix2d::Zero()};
  };
  const OptimizerResult result = climb_alone(batched(flat), from({1.0, 2.0}));
  EXPECT_EQ(result.evaluations, 1);
  EXPECT_EQ(result.best, (std::vector<double>{1.0, 2.0}));
  EXPECT_EQ(result.value, 3.0);
}

TEST(LevenbergMarquardt, SearchesInStepEndAsAlone) {
  const std::vector<OptimizerOptions> searches = {from({-1.2, 1.0}), from({3.0, -4.0}), from({0.9, 0.8})};
  const std::vector<OptimizerResult> together = maximize(batched(rosenbrock), searches);
  for (std::size_t n = 0; n < searches.size(); ++n) {
    const OptimizerResult alone = climb_alone(batched(rosenbrock), searches[n]);
    EXPECT_EQ(together[n].best, alone.best);
    EXPECT_EQ(together[n].evaluations, alone.evaluations);
  }
}

TEST(LevenbergMarquardt, FailuresPassThrough) {
  const BatchModel failing = [](std::span<const std::vector<double>>) -> std::vector<QuadraticModel> {
    throw Error("no model");
  };
  const OptimizerOptions options = from({0.0, 0.0});
  EXPECT_THROW(climb(failing, std::span(&options, 1)), Error);
}

}  // namespace
}  // namespace isoshift::levenberg_marquardt_test
