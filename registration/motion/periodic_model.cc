#include "registration/motion/periodic_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"
#include "geometry/linear_algebra.h"

namespace isoshift {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
constexpr int kHarmonics = 3;
constexpr double kShortestPeriodS = 1.5, kLongestPeriodS = 10.0;
constexpr double kGridS = 0.1;  // on which periods are looked for

Eigen::RowVectorXd harmonics(double phase_rad, int count) {
  Eigen::RowVectorXd row(2 * count);
  for (int n = 0; n < count; ++n) {
    row[2 * n] = std::cos((n + 1) * phase_rad);
    row[2 * n + 1] = std::sin((n + 1) * phase_rad);
  }
  return row;
}

// Least squares of the harmonics and a constant, which is left out of the result.
Eigen::MatrixXd fitted(const std::vector<double>& phases_rad, const std::vector<Eigen::VectorXd>& positions_mm,
                       int count) {
  const auto rows = static_cast<Eigen::Index>(phases_rad.size());
  Eigen::MatrixXd design(rows, 2 * count + 1), values(rows, positions_mm.front().size());
  for (Eigen::Index row = 0; row < rows; ++row) {
    design.row(row) << harmonics(phases_rad[static_cast<std::size_t>(row)], count), 1.0;
    values.row(row) = positions_mm[static_cast<std::size_t>(row)];
  }
  return least_squares(design, values).topRows(2 * count);
}

std::vector<double> even_phases(std::size_t count) {
  if (count < 4) throw UsageError("a periodic trajectory needs at least 4 phases");
  std::vector<double> phases_rad(count);
  for (std::size_t n = 0; n < count; ++n) phases_rad[n] = kTurn * static_cast<double>(n) / static_cast<double>(count);
  return phases_rad;
}

std::vector<double> phases_of(const std::vector<double>& times_s, double period_s) {
  std::vector<double> phases_rad;
  phases_rad.reserve(times_s.size());
  for (const double time_s : times_s) phases_rad.push_back(kTurn * time_s / period_s);
  return phases_rad;
}

}  // namespace

PeriodicTrajectory::PeriodicTrajectory(const std::vector<Eigen::VectorXd>& phases_mm)
    : coefficients_(fitted(even_phases(phases_mm.size()), phases_mm,
                           std::min(kHarmonics, (static_cast<int>(phases_mm.size()) - 1) / 2))) {}

PeriodicTrajectory::PeriodicTrajectory(const std::vector<double>& times_s,
                                       const std::vector<Eigen::VectorXd>& positions_mm, double period_s)
    : coefficients_(fitted(phases_of(times_s, period_s), positions_mm, kHarmonics)) {}

Eigen::VectorXd PeriodicTrajectory::at(double phase_rad) const {
  return transposed_product(coefficients_,
                            harmonics(phase_rad, static_cast<int>(coefficients_.rows() / 2)).transpose());
}

Eigen::VectorXd PeriodicTrajectory::derivative_at(double phase_rad) const {
  Eigen::RowVectorXd row = harmonics(phase_rad, static_cast<int>(coefficients_.rows() / 2));
  for (Eigen::Index n = 0; n < row.size() / 2; ++n) {
    const double order = static_cast<double>(n + 1), cosine = row[2 * n];
    row[2 * n] = -order * row[2 * n + 1];
    row[2 * n + 1] = order * cosine;
  }
  return transposed_product(coefficients_, row.transpose());
}

std::optional<double> period_of(const std::vector<double>& times_s, const std::vector<Eigen::VectorXd>& positions_mm) {
  // The direction of most motion, on an even grid.
  const auto count = static_cast<Eigen::Index>(positions_mm.size());
  if (count < 8) return std::nullopt;
  Eigen::MatrixXd all(count, positions_mm.front().size());
  for (Eigen::Index n = 0; n < count; ++n) all.row(n) = positions_mm[static_cast<std::size_t>(n)];
  all.rowwise() -= all.colwise().mean().eval();
  const SymmetricEigen axes = symmetric_eigen(transposed_product(all, all));
  const Eigen::VectorXd along = product(all, axes.vectors.rightCols(1));
  std::vector<double> grid;
  std::size_t next = 1;
  for (double time_s = times_s.front(); time_s <= times_s.back() && next < times_s.size(); time_s += kGridS) {
    while (next + 1 < times_s.size() && times_s[next] < time_s) ++next;
    const double share = (time_s - times_s[next - 1]) / (times_s[next] - times_s[next - 1]);
    const auto n = static_cast<Eigen::Index>(next);
    grid.push_back(along[n - 1] + share * (along[n] - along[n - 1]));
  }
  const auto correlation = [&](std::size_t lag) {
    double product = 0.0, a = 0.0, b = 0.0;
    for (std::size_t n = 0; n + lag < grid.size(); ++n) {
      product += grid[n] * grid[n + lag];
      a += grid[n] * grid[n];
      b += grid[n + lag] * grid[n + lag];
    }
    return a > 0.0 && b > 0.0 ? product / std::sqrt(a * b) : 0.0;
  };
  constexpr double kRepeats = 0.3;
  const auto first = static_cast<std::size_t>(kShortestPeriodS / kGridS);
  const auto last = std::min(static_cast<std::size_t>(kLongestPeriodS / kGridS), grid.size() / 2);
  std::optional<double> period_s;
  double best = kRepeats;
  for (std::size_t lag = first; lag + 1 < last; ++lag) {
    const double here = correlation(lag);
    if (here < correlation(lag - 1) || here < correlation(lag + 1)) continue;
    // The first of peaks that are alike: not two cycles.
    if (here > best + 0.05) {
      best = here;
      period_s = static_cast<double>(lag) * kGridS;
    }
  }
  return period_s;
}

Eigen::MatrixXd PeriodicModelKalman::measured_from_state(const Eigen::VectorXd& mean) const {
  const Eigen::Index axes = mean.size() - 3;
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(axes, mean.size());
  result.col(0) = mean[2] * trajectory_->derivative_at(mean[0]);
  result.col(2) = trajectory_->at(mean[0]);
  result.rightCols(axes).setIdentity();
  return result;
}

// Finds the trajectory, or in one that is given the period, and then phase and offset that fit what was measured.
void PeriodicModelKalman::start(double time_s) {
  const std::optional<double> period_s = period_of(times_s_, positions_mm_);
  if (!period_s) {  // nothing repeats yet: the oldest measurements are given up
    const auto half = static_cast<std::ptrdiff_t>(times_s_.size() / 2);
    times_s_.erase(times_s_.begin(), times_s_.begin() + half);
    positions_mm_.erase(positions_mm_.begin(), positions_mm_.begin() + half);
    return;
  }
  std::vector<double> from_now_s;
  for (const double at_s : times_s_) from_now_s.push_back(at_s - time_s);
  trajectory_ = options_.phases_mm.empty() ? PeriodicTrajectory(from_now_s, positions_mm_, *period_s)
                                           : PeriodicTrajectory(options_.phases_mm);
  constexpr int kPhases = 72;
  double least = 1e300;
  const Eigen::Index axes = positions_mm_.front().size();
  mean_ = Eigen::VectorXd::Zero(3 + axes);
  for (int n = 0; n < kPhases; ++n) {
    const double phase_now = kTurn * n / kPhases;
    Eigen::VectorXd offset = Eigen::VectorXd::Zero(axes);
    const auto residual = [&](std::size_t i) -> Eigen::VectorXd {
      return positions_mm_[i] - trajectory_->at(phase_now + kTurn * from_now_s[i] / *period_s);
    };
    for (std::size_t i = 0; i < from_now_s.size(); ++i) offset += residual(i) / static_cast<double>(from_now_s.size());
    double sum = 0.0;
    for (std::size_t i = 0; i < from_now_s.size(); ++i) sum += (residual(i) - offset).squaredNorm();
    if (sum >= least) continue;
    least = sum;
    mean_[0] = phase_now;
    mean_.tail(axes) = offset;
  }
  mean_[1] = kTurn / *period_s;
  mean_[2] = 1.0;
  covariance_ = Eigen::MatrixXd::Identity(mean_.size(), mean_.size());
  covariance_(0, 0) = 0.05;
  covariance_(1, 1) = 0.05;
  covariance_(2, 2) = 0.05;
  time_s_ = time_s;
  times_s_.clear();
  positions_mm_.clear();
}

void PeriodicModelKalman::advance(double dt, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const {
  mean[0] += dt * mean[1];
  Eigen::MatrixXd step = Eigen::MatrixXd::Identity(mean.size(), mean.size());
  step(0, 1) = dt;
  covariance = propagated(step, covariance);
  covariance(0, 0) += options_.phase_noise * options_.phase_noise * dt;
  covariance(1, 1) += options_.speed_noise * options_.speed_noise * dt;
  covariance(2, 2) += options_.depth_noise * options_.depth_noise * dt;
  covariance.diagonal().tail(mean.size() - 3).array() += options_.offset_noise * options_.offset_noise * dt;
}

void PeriodicModelKalman::correct(const Eigen::VectorXd& position_mm, const Eigen::MatrixXd& covariance_mm2) {
  const Eigen::MatrixXd h = measured_from_state(mean_);
  const Eigen::VectorXd expected = mean_.tail(position_mm.size()) + mean_[2] * trajectory_->at(mean_[0]);
  const Eigen::MatrixXd innovation = propagated(h, covariance_) + covariance_mm2;
  const Eigen::MatrixXd measured = product(h, covariance_);
  const Eigen::MatrixXd gain = solve_symmetric(innovation, measured).transpose();
  mean_ += product(gain, position_mm - expected);
  covariance_ -= product(gain, measured);
  covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
  mean_[0] = std::remainder(mean_[0], kTurn);
  mean_[1] = std::clamp(mean_[1], kTurn / kLongestPeriodS, kTurn / kShortestPeriodS);
  mean_[2] = std::clamp(mean_[2], 0.1, 3.0);
}

void PeriodicModelKalman::take(double time_s, const Eigen::VectorXd& position_mm,
                               const Eigen::MatrixXd& covariance_mm2) {
  last_mm_ = position_mm;
  if (!trajectory_) {
    times_s_.push_back(time_s);
    positions_mm_.push_back(position_mm);
    if (time_s - times_s_.front() >= options_.learning_s) start(time_s);
    return;
  }
  advance(time_s - time_s_, mean_, covariance_);
  time_s_ = time_s;
  correct(position_mm, covariance_mm2);
}

Prediction PeriodicModelKalman::predict(double time_s) const {
  if (!trajectory_) return {.position_mm = last_mm_, .sigma_mm = std::nullopt};
  Eigen::VectorXd mean = mean_;
  Eigen::MatrixXd covariance = covariance_;
  advance(time_s - time_s_, mean, covariance);
  const Eigen::Index axes = last_mm_.size();
  const Eigen::MatrixXd h = measured_from_state(mean);
  return {.position_mm = mean.tail(axes) + mean[2] * trajectory_->at(mean[0]),
          .sigma_mm = propagated(h, covariance).diagonal().cwiseSqrt()};
}

}  // namespace isoshift
