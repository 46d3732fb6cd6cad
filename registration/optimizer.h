#pragma once
// Local optimization within a box, by NLopt. Points come in batches: the differences of a gradient, and of several
// searches the steps of all, so that one call of the objective fills a machine.

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace isoshift {

enum class OptimizerKind {
  kBobyqa,      // quadratic models, no derivatives (Powell 2009)
  kNelderMead,  // simplex, no derivatives
  kLbfgs,       // quasi-Newton on central differences, which cost 13 evaluations per step but come in one batch
};
inline constexpr std::array kOptimizerKinds = {OptimizerKind::kBobyqa, OptimizerKind::kNelderMead,
                                               OptimizerKind::kLbfgs};
std::string_view to_string(OptimizerKind kind);
std::optional<OptimizerKind> optimizer_kind_from(std::string_view name);

struct OptimizerOptions {
  OptimizerKind kind = OptimizerKind::kBobyqa;
  std::vector<double> start;
  std::vector<double> lower, upper;  // the box; start lies inside
  std::vector<double> initial_step;  // first trust-region radius per parameter
  double relative_tolerance = 1e-3;  // stop when steps fall below this share of the initial step
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

// The largest value of `objective` found by each of several searches, which go on in step: every call of the objective
// holds what each of them asks for next. What one finds does not depend on the others. Exceptions of the objective pass
// through.
std::vector<OptimizerResult> maximize(const BatchObjective& objective, std::span<const OptimizerOptions> searches);

}  // namespace isoshift
