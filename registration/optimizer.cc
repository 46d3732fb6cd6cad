#include "registration/optimizer.h"

#include <exception>
#include <nlopt.hpp>

namespace isoshift {
namespace {

std::string reason(nlopt::result result) {
  switch (result) {
    case nlopt::XTOL_REACHED: return "step tolerance reached";
    case nlopt::FTOL_REACHED: return "value tolerance reached";
    case nlopt::MAXEVAL_REACHED: return "evaluation limit reached";
    case nlopt::SUCCESS: return "converged";
    default: return "stopped";
  }
}

}  // namespace

OptimizerResult maximize(const std::function<double(std::span<const double>)>& objective,
                         const OptimizerOptions& options) {
  OptimizerResult result;
  nlopt::opt bobyqa(nlopt::LN_BOBYQA, static_cast<unsigned>(options.start.size()));
  bobyqa.set_lower_bounds(options.lower);
  bobyqa.set_upper_bounds(options.upper);
  bobyqa.set_initial_step(options.initial_step);
  std::vector<double> tolerance = options.initial_step;
  for (double& step : tolerance) step *= options.relative_tolerance;
  bobyqa.set_xtol_abs(tolerance);
  bobyqa.set_maxeval(options.max_evaluations);
  struct Call {
    const std::function<double(std::span<const double>)>& objective;
    int& evaluations;
    std::exception_ptr failure;  // nlopt would replace it by one of its own
  } call{objective, result.evaluations, nullptr};
  bobyqa.set_max_objective(
      [](const std::vector<double>& x, std::vector<double>&, void* data) {
        auto& [function, evaluations, failure] = *static_cast<Call*>(data);
        ++evaluations;
        try {
          return function(x);
        } catch (...) {
          failure = std::current_exception();
          throw nlopt::forced_stop();
        }
      },
      &call);
  result.best = options.start;
  try {
    result.termination = reason(bobyqa.optimize(result.best, result.value));
  } catch (const nlopt::forced_stop&) {
    std::rethrow_exception(call.failure);
  } catch (const nlopt::roundoff_limited&) {
    result.value = bobyqa.last_optimum_value();  // `best` holds the best point so far
    result.termination = "limited by round-off";
  }
  return result;
}

}  // namespace isoshift
