#include "registration/motion/rls.h"

#include <algorithm>
#include <cmath>

#include "geometry/linear_algebra.h"

namespace isoshift {

// Between the measurements around a moment, linearly.
Eigen::VectorXd RecursiveLeastSquares::position_at(double time_s) const {
  const auto after = std::ranges::lower_bound(samples_, time_s, {}, &Sample::time_s);
  if (after == samples_.begin()) return samples_.front().position;
  if (after == samples_.end()) return samples_.back().position;
  const Sample& before = *std::prev(after);
  const double share = (time_s - before.time_s) / (after->time_s - before.time_s);
  return before.position + share * (after->position - before.position);
}

// Of a measurement at that moment; nothing where the taps reach back behind the first one.
std::optional<Eigen::VectorXd> RecursiveLeastSquares::regressors(double time_s) const {
  if (time_s - (options_.taps - 1) * options_.tap_s < samples_.front().time_s - 1e-9) return std::nullopt;
  const Eigen::Index n = origin_.size();
  Eigen::VectorXd result(options_.taps * n + 1);
  for (int tap = 0; tap < options_.taps; ++tap) result.segment(tap * n, n) = position_at(time_s - tap * options_.tap_s);
  result[options_.taps * n] = 1.0;
  return result;
}

void RecursiveLeastSquares::learn(const Eigen::VectorXd& f, const Eigen::VectorXd& target) {
  const Eigen::VectorXd projected = product(inverse_, f);
  const Eigen::VectorXd gain = projected / (options_.forgetting + f.dot(projected));
  weights_ += product(gain, (target - transposed_product(weights_, f)).transpose());
  inverse_ = (inverse_ - product(gain, projected.transpose())) / options_.forgetting;
  inverse_ = 0.5 * (inverse_ + inverse_.transpose()).eval();
  // Forgetting without anything new would let it grow without end.
  const double largest = static_cast<double>(f.size()) / options_.regularization;
  if (const double trace = inverse_.trace(); trace > largest) inverse_ *= largest / trace;
  ++learned_;
}

void RecursiveLeastSquares::take(double time_s, const Eigen::VectorXd& position_mm, const Eigen::MatrixXd&) {
  if (samples_.empty()) {
    origin_ = position_mm;
    const Eigen::Index size = options_.taps * origin_.size() + 1;
    weights_ = Eigen::MatrixXd::Zero(size, origin_.size());
    inverse_ = Eigen::MatrixXd::Identity(size, size) / options_.regularization;
  }
  samples_.push_back({time_s, position_mm - origin_});

  // What could have been predicted for a moment up to now: from every measurement one latency before it.
  for (const Sample& from : samples_) {
    if (from.time_s <= learned_until_s_ || from.time_s + options_.latency_s > time_s + 1e-9) continue;
    learned_until_s_ = from.time_s;
    const Eigen::VectorXd target = position_at(from.time_s + options_.latency_s);
    farthest_mm_ = std::max(farthest_mm_, (target - from.position).norm());
    if (const auto f = regressors(from.time_s)) learn(*f, target);
  }
  const double reach_s = options_.latency_s + options_.taps * options_.tap_s;
  while (samples_.size() > 2 && samples_[1].time_s < time_s - reach_s - 1.0) samples_.pop_front();
}

bool RecursiveLeastSquares::is_warm() const { return learned_ > weights_.rows() && regressors(samples_.back().time_s); }

Prediction RecursiveLeastSquares::predict(double time_s) const {
  const Sample& last = samples_.back();
  if (!is_warm()) return {.position_mm = origin_ + last.position, .sigma_mm = std::nullopt};
  Eigen::VectorXd way = transposed_product(weights_, *regressors(last.time_s)) - last.position;
  // Never much farther than it ever moved within the latency.
  constexpr double kFarther = 1.5;
  if (const double length = way.norm(); length > kFarther * farthest_mm_) way *= kFarther * farthest_mm_ / length;
  const double share = std::clamp((time_s - last.time_s) / options_.latency_s, 0.0, 1.0);
  return {.position_mm = origin_ + last.position + share * way, .sigma_mm = std::nullopt};
}

}  // namespace isoshift
