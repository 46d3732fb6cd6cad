#include "registration/optimizer.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <iterator>
#include <mutex>
#include <nlopt.hpp>
#include <thread>

#include "registration/levenberg_marquardt.h"

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

nlopt::algorithm algorithm_of(OptimizerKind kind) {
  switch (kind) {
    case OptimizerKind::kBobyqa: return nlopt::LN_BOBYQA;
    case OptimizerKind::kNelderMead: return nlopt::LN_NELDERMEAD;
    case OptimizerKind::kSbplx: return nlopt::LN_SBPLX;
    case OptimizerKind::kNewuoa: return nlopt::LN_NEWUOA_BOUND;
    case OptimizerKind::kLbfgs: return nlopt::LD_LBFGS;
    case OptimizerKind::kLevenbergMarquardt: break;  // climb()
  }
  return nlopt::LN_BOBYQA;
}

using Points = std::vector<std::vector<double>>;

// The value at a point and, where a gradient is wanted, on both sides of it along every axis, in one batch.
class Differences {
 public:
  Differences(const OptimizerOptions& options, const std::vector<double>& x, bool with_gradient) : points_{x} {
    for (std::size_t axis = 0; with_gradient && axis < x.size(); ++axis) {
      const double step = options.difference_share * options.initial_step[axis];
      points_.push_back(x);
      points_.back()[axis] = std::max(options.lower[axis], x[axis] - step);
      points_.push_back(x);
      points_.back()[axis] = std::min(options.upper[axis], x[axis] + step);
    }
  }
  const Points& points() const { return points_; }
  std::vector<double> gradient(const std::vector<double>& values) const {
    std::vector<double> gradient;
    for (std::size_t n = 1; n < points_.size(); n += 2) {
      const std::size_t axis = n / 2;
      gradient.push_back((values[n + 1] - values[n]) / (points_[n + 1][axis] - points_[n][axis]));
    }
    return gradient;
  }

 private:
  Points points_;
};

// The value at a point; with its gradient, if that is asked for (not empty).
using Evaluate = std::function<double(const std::vector<double>& x, std::vector<double>& gradient, int& evaluations)>;

// One search. What `evaluate` throws passes through.
OptimizerResult maximize_one(const Evaluate& evaluate, const OptimizerOptions& options, int evaluations_per_call) {
  OptimizerResult result;
  nlopt::opt search(algorithm_of(options.kind), static_cast<unsigned>(options.start.size()));
  search.set_lower_bounds(options.lower);
  search.set_upper_bounds(options.upper);
  search.set_initial_step(options.initial_step);
  std::vector<double> tolerance = options.initial_step;
  for (double& step : tolerance) step *= options.relative_tolerance;
  search.set_xtol_abs(tolerance);
  search.set_maxeval(std::max(1, options.max_evaluations / evaluations_per_call));
  struct Call {
    const Evaluate& evaluate;
    int& evaluations;
    std::exception_ptr failure;  // nlopt would replace it by one of its own
  } call{evaluate, result.evaluations, nullptr};
  search.set_max_objective(
      [](const std::vector<double>& x, std::vector<double>& gradient, void* data) {
        Call& c = *static_cast<Call*>(data);
        try {
          return c.evaluate(x, gradient, c.evaluations);
        } catch (...) {
          c.failure = std::current_exception();
          throw nlopt::forced_stop();
        }
      },
      &call);
  result.best = options.start;
  try {
    const nlopt::result how = search.optimize(result.best, result.value);
    result.termination = reason(how);
    result.reached_limit = how == nlopt::MAXEVAL_REACHED;
  } catch (const nlopt::forced_stop&) {
    std::rethrow_exception(call.failure);
  } catch (const nlopt::roundoff_limited&) {
    result.value = search.last_optimum_value();  // `best` holds the best point so far
    result.termination = "limited by round-off";
  } catch (const std::runtime_error&) {
    if (options.kind != OptimizerKind::kLbfgs) throw;
    result.value = search.last_optimum_value();
    result.termination =
        "line search ended";  // NLopt's L-BFGS calls it a failure where differences are as coarse as ours
  }
  return result;
}

// How a search evaluates its objective, given the answers to a batch of points.
template <class Answer>
using Ask = std::function<std::vector<Answer>(const Points&)>;

OptimizerResult maximize_one(const Ask<double>& values_at, const OptimizerOptions& options) {
  const auto with_differences = [&](const std::vector<double>& x, std::vector<double>& gradient, int& evaluations) {
    const Differences differences(options, x, !gradient.empty());
    const std::vector<double> values = values_at(differences.points());
    evaluations += static_cast<int>(values.size());
    if (!gradient.empty()) gradient = differences.gradient(values);
    return values.front();
  };
  const auto per_call = Differences(options, options.start, options.kind == OptimizerKind::kLbfgs).points().size();
  return maximize_one(with_differences, options, static_cast<int>(per_call));
}

OptimizerResult maximize_one(const Ask<QuadraticModel>& models_at, const OptimizerOptions& options) {
  const auto with_gradient = [&](const std::vector<double>& x, std::vector<double>& gradient, int& evaluations) {
    const QuadraticModel model = models_at({x}).front();
    ++evaluations;
    if (!gradient.empty()) std::ranges::copy(model.gradient, gradient.begin());
    return model.value;
  };
  return maximize_one(with_gradient, options, 1);
}

// What several searches, each on a thread of its own, ask for: gathered until all that still run are waiting.
template <class Answer>
class LockStep {
 public:
  explicit LockStep(std::size_t searches) : asked_(searches), answers_(searches), running_(searches) {}

  // Called by a search: waits for the next call of the objective.
  std::vector<Answer> ask(std::size_t search, const Points& points) {
    std::unique_lock lock(mutex_);
    asked_[search] = &points;
    ++waiting_;
    changed_.notify_all();
    changed_.wait(lock, [&] { return asked_[search] == nullptr || abandoned_; });
    if (abandoned_) throw nlopt::forced_stop();
    return std::move(answers_[search]);
  }

  // Called by a search at its end.
  void leave() {
    const std::lock_guard lock(mutex_);
    --running_;
    changed_.notify_all();
  }

  // Answers until no search runs. If the objective throws, all searches are told to stop.
  template <class Batch>
  void serve(const Batch& objective) {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [&] { return waiting_ == running_; });
      if (running_ == 0) return;
      Points points;
      for (const Points* of_search : asked_)
        if (of_search != nullptr) points.insert(points.end(), of_search->begin(), of_search->end());
      std::vector<Answer> values;
      try {
        values = objective(points);
      } catch (...) {
        abandoned_ = true;
        changed_.notify_all();
        throw;
      }
      auto next = values.begin();
      for (std::size_t search = 0; search < asked_.size(); ++search) {
        if (asked_[search] == nullptr) continue;
        const auto end = next + static_cast<std::ptrdiff_t>(asked_[search]->size());
        answers_[search].assign(std::make_move_iterator(next), std::make_move_iterator(end));
        next = end;
        asked_[search] = nullptr;
      }
      waiting_ = 0;
      changed_.notify_all();
    }
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<const Points*> asked_;
  std::vector<std::vector<Answer>> answers_;
  std::size_t running_, waiting_ = 0;
  bool abandoned_ = false;
};

// All searches, each on a thread of its own, in step.
template <class Answer, class Batch>
std::vector<OptimizerResult> maximize_all(const Batch& objective, std::span<const OptimizerOptions> searches) {
  if (searches.size() == 1) return {maximize_one(Ask<Answer>(objective), searches.front())};
  std::vector<OptimizerResult> results(searches.size());
  std::vector<std::exception_ptr> failures(searches.size());
  LockStep<Answer> lock_step(searches.size());
  std::vector<std::jthread> threads;  // joined before what they refer to ends
  threads.reserve(searches.size());
  for (std::size_t n = 0; n < searches.size(); ++n)
    threads.emplace_back([&, n] {
      try {
        const auto ask = [&](const Points& points) { return lock_step.ask(n, points); };
        results[n] = maximize_one(Ask<Answer>(ask), searches[n]);
      } catch (...) {
        failures[n] = std::current_exception();
      }
      lock_step.leave();
    });
  lock_step.serve(objective);  // throws what the objective throws
  threads.clear();
  for (const std::exception_ptr& failure : failures)
    if (failure) std::rethrow_exception(failure);
  return results;
}

}  // namespace

std::string_view to_string(OptimizerKind kind) {
  switch (kind) {
    case OptimizerKind::kBobyqa: return "bobyqa";
    case OptimizerKind::kNelderMead: return "nelder-mead";
    case OptimizerKind::kSbplx: return "sbplx";
    case OptimizerKind::kNewuoa: return "newuoa";
    case OptimizerKind::kLbfgs: return "l-bfgs";
    case OptimizerKind::kLevenbergMarquardt: return "levenberg-marquardt";
  }
  return "";
}

std::optional<OptimizerKind> optimizer_kind_from(std::string_view name) {
  for (const OptimizerKind kind : kOptimizerKinds)
    if (to_string(kind) == name) return kind;
  return std::nullopt;
}

std::vector<OptimizerResult> maximize(const BatchObjective& objective, std::span<const OptimizerOptions> searches) {
  return maximize_all<double>(objective, searches);
}

std::vector<OptimizerResult> maximize(const BatchModel& models, std::span<const OptimizerOptions> searches) {
  if (searches.front().kind == OptimizerKind::kLevenbergMarquardt) return climb(models, searches);
  return maximize_all<QuadraticModel>(models, searches);
}

}  // namespace isoshift
