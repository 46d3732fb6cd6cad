#include "registration/levenberg_marquardt.h"

#include <algorithm>
#include <cmath>

#include "geometry/linear_algebra.h"

namespace isoshift {
namespace {

// The step, in units of the initial steps, that a model promises most from within a radius. The damping that makes it
// that short is found by Newton's method on 1 / length (Moré and Sorensen 1983), which comes from below and does not
// overshoot.
Eigen::VectorXd best_step(const Eigen::VectorXd& gradient, Eigen::MatrixXd curvature, double radius) {
  constexpr double kLeastDamping = 1e-9, kLonger = 1.001;
  constexpr int kMostSteps = 60;
  double added = kLeastDamping * std::max(curvature.diagonal().maxCoeff(), 1e-12);
  Eigen::VectorXd step;
  for (int n = 0; n < kMostSteps; ++n) {
    curvature.diagonal().array() += added;
    step = solve_symmetric(curvature, gradient);
    const double length = step.norm();
    if (length <= kLonger * radius) break;
    added = step.squaredNorm() / step.dot(solve_symmetric(curvature, step).col(0)) * (length - radius) / radius;
  }
  return step;
}

// One climb: says where it wants a model next, and takes it.
class Climb {
 public:
  explicit Climb(const OptimizerOptions& options)
      : options_(options),
        steps_(Eigen::Map<const Eigen::VectorXd>(options.initial_step.data(),
                                                 static_cast<Eigen::Index>(options.initial_step.size()))),
        next_(options.start) {
    result_.best = options.start;
  }

  bool is_running() const { return running_; }
  const std::vector<double>& next() const { return next_; }
  const OptimizerResult& result() const { return result_; }

  void take(QuadraticModel model) {
    ++result_.evaluations;
    const bool first = result_.evaluations == 1;
    const double gain = first ? 0.0 : model.value - model_.value;
    if (!first) {
      constexpr double kPoor = 0.25, kGood = 0.75, kBetterThanPromised = 1.5, kLeastCurvature = 0.25;
      if (gain < kPoor * promised_) radius_ = kPoor * step_length_;
      if (gain > kGood * promised_ && step_length_ > 0.9 * radius_) radius_ *= 2.0;
      if (gain > kBetterThanPromised * promised_) curvature_share_ = std::max(kLeastCurvature, 0.5 * curvature_share_);
      if (gain < kGood * promised_) curvature_share_ = std::min(1.0, 2.0 * curvature_share_);
    }
    if (first || gain > 0.0) {
      result_.best = next_;
      result_.value = model.value;
      model_ = std::move(model);
    }
    propose();
  }

 private:
  void end(const char* why) {
    running_ = false;
    result_.termination = why;
  }

  // Whether the best point lies on a side of the box, and the climb leads out there.
  bool is_held(std::size_t axis) const {
    const double slope = model_.gradient[static_cast<Eigen::Index>(axis)], at = result_.best[axis];
    return (at <= options_.lower[axis] && slope < 0.0) || (at >= options_.upper[axis] && slope > 0.0);
  }

  // The next point: the best step of the model at the best point, kept inside the box.
  void propose() {
    if (radius_ < options_.relative_tolerance) return end("step tolerance reached");
    if (result_.evaluations >= options_.max_evaluations) {
      result_.reached_limit = true;
      return end("evaluation limit reached");
    }
    Eigen::VectorXd gradient = model_.gradient.cwiseProduct(steps_);
    Eigen::MatrixXd curvature = curvature_share_ * (steps_.asDiagonal() * model_.curvature * steps_.asDiagonal());
    for (std::size_t axis = 0; axis < next_.size(); ++axis)
      if (is_held(axis)) {
        const auto n = static_cast<Eigen::Index>(axis);
        gradient[n] = 0.0;
        curvature.row(n).setZero();
        curvature.col(n).setZero();
      }
    Eigen::VectorXd step = best_step(gradient, curvature, radius_);
    for (std::size_t axis = 0; axis < next_.size(); ++axis) {
      const auto n = static_cast<Eigen::Index>(axis);
      next_[axis] = std::clamp(result_.best[axis] + step[n] * steps_[n], options_.lower[axis], options_.upper[axis]);
      step[n] = (next_[axis] - result_.best[axis]) / steps_[n];
    }
    step_length_ = step.norm();
    promised_ = gradient.dot(step) - 0.5 * step.dot(curvature * step);
    if (step_length_ < options_.relative_tolerance || !(promised_ > 0.0)) return end("step tolerance reached");
    if (promised_ < options_.least_gain) end("nothing more to gain");
  }

  OptimizerOptions options_;
  Eigen::VectorXd steps_;  // the unit of the trust region
  std::vector<double> next_;
  QuadraticModel model_;  // at the best point
  OptimizerResult result_;
  double radius_ = 1.0, step_length_ = 0.0, promised_ = 0.0;
  // Of the models' curvature. Gauss-Newton's is too large where residuals weigh less the larger they are: steps end
  // short, and gain more than they promise.
  double curvature_share_ = 1.0;
  bool running_ = true;
};

}  // namespace

std::vector<OptimizerResult> climb(const BatchModel& models, std::span<const OptimizerOptions> searches) {
  std::vector<Climb> climbs(searches.begin(), searches.end());
  for (;;) {
    std::vector<Climb*> running;
    std::vector<std::vector<double>> points;
    for (Climb& one : climbs)
      if (one.is_running()) {
        running.push_back(&one);
        points.push_back(one.next());
      }
    if (running.empty()) break;
    std::vector<QuadraticModel> at_points = models(points);
    for (std::size_t n = 0; n < running.size(); ++n) running[n]->take(std::move(at_points[n]));
  }
  std::vector<OptimizerResult> results;
  results.reserve(climbs.size());
  for (const Climb& one : climbs) results.push_back(one.result());
  return results;
}

}  // namespace isoshift
