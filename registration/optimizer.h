#pragma once
// Local optimization within a box, by NLopt. Points come in batches, so that one call of the objective keeps all cores
// busy: the points for the differences of a gradient, and the next points of several searches.

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "registration/quadratic_model.h"

namespace isoshift {

enum class OptimizerKind {
  kBobyqa,      // quadratic models, no derivatives (Powell 2009)
  kNelderMead,  // simplex, no derivatives
  kSbplx,       // simplex on subspaces, no derivatives (Rowan 1990)
  kNewuoa,      // as kBobyqa, its predecessor (Powell 2006)
  kLbfgs,  // quasi-Newton (Nocedal 1980); without models on central differences, 13 evaluations per step in one batch
  kLevenbergMarquardt,  // Gauss-Newton with damping, on models that have a curvature (levenberg_marquardt.h)
};
inline constexpr std::array kOptimizerKinds = {OptimizerKind::kBobyqa, OptimizerKind::kNelderMead,
                                               OptimizerKind::kSbplx,  OptimizerKind::kNewuoa,
                                               OptimizerKind::kLbfgs,  OptimizerKind::kLevenbergMarquardt};
std::string_view to_string(OptimizerKind kind);
std::optional<OptimizerKind> optimizer_kind_from(std::string_view name);

struct OptimizerOptions {
  OptimizerKind kind = OptimizerKind::kBobyqa;
  std::vector<double> start;
  std::vector<double> lower, upper;  // the box; start lies inside
  std::vector<double> initial_step;  // first trust-region radius per parameter
  double relative_tolerance = 1e-3;  // stop when steps fall below this share of the initial step
  double least_gain = 0.0;           // kLevenbergMarquardt: stop when no more is to be gained by a step
  double difference_share = 0.05;    // kLbfgs: differences are taken over this share of the initial step, both ways
  int max_evaluations = 500;
};

struct OptimizerResult {
  std::vector<double> best;
  double value = 0.0;
  int evaluations = 0;
  std::string termination = "not run";
  bool reached_limit = false;  // of the evaluations, before it converged
};

// One value per point.
using BatchObjective = std::function<std::vector<double>(std::span<const std::vector<double>>)>;

// One model per point: for objectives that know their derivatives.
using BatchModel = std::function<std::vector<QuadraticModel>(std::span<const std::vector<double>>)>;

// Runs several searches at the same time and returns the largest value of `objective` that each of them found. Every
// call of the objective holds the next points of all searches. The result of a search does not depend on the others.
// Exceptions of the objective pass through.
// The same with models, for searches that all are kLbfgs or all kLevenbergMarquardt.
std::vector<OptimizerResult> maximize(const BatchObjective& objective, std::span<const OptimizerOptions> searches);
std::vector<OptimizerResult> maximize(const BatchModel& models, std::span<const OptimizerOptions> searches);

}  // namespace isoshift
