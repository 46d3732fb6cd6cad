#pragma once
// Derivative-free local optimization within a box, by NLopt's BOBYQA (Powell 2009).

#include <functional>
#include <span>
#include <string>
#include <vector>

namespace isoshift {

struct OptimizerOptions {
  std::vector<double> start;
  std::vector<double> lower, upper;  // the box; start lies inside
  std::vector<double> initial_step;  // first trust-region radius per parameter
  double relative_tolerance = 1e-3;  // stop when steps fall below this share of the initial step
  int max_evaluations = 500;
};

struct OptimizerResult {
  std::vector<double> best;
  double value = 0.0;
  int evaluations = 0;
  std::string termination = "not run";
};

// The largest value of `objective` found. Exceptions of the objective pass through.
OptimizerResult maximize(const std::function<double(std::span<const double>)>& objective,
                         const OptimizerOptions& options);

}  // namespace isoshift
