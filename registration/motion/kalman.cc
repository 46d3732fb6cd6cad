#include "registration/motion/kalman.h"

#include "geometry/linear_algebra.h"

namespace isoshift {
namespace {

constexpr double kFirstSpeedMmPerS = 20.0;  // one standard deviation of the velocity before anything is known

}  // namespace

// x <- F x, P <- F P F' + Q with Q of white acceleration noise q over dt: q [dt^3/3, dt^2/2; dt^2/2, dt].
ConstantVelocityKalman::State ConstantVelocityKalman::at(double time_s) const {
  const double dt = time_s - time_s_;
  const Eigen::Index n = mean_.size() / 2;
  Eigen::MatrixXd step = Eigen::MatrixXd::Identity(2 * n, 2 * n);
  step.topRightCorner(n, n).diagonal().setConstant(dt);
  State state{.mean = product(step, mean_), .covariance = propagated(step, covariance_)};
  state.covariance.topLeftCorner(n, n).diagonal().array() += acceleration_noise_ * dt * dt * dt / 3.0;
  state.covariance.topRightCorner(n, n).diagonal().array() += acceleration_noise_ * dt * dt / 2.0;
  state.covariance.bottomLeftCorner(n, n).diagonal().array() += acceleration_noise_ * dt * dt / 2.0;
  state.covariance.bottomRightCorner(n, n).diagonal().array() += acceleration_noise_ * dt;
  return state;
}

void ConstantVelocityKalman::take(double time_s, const Eigen::VectorXd& position_mm,
                                  const Eigen::MatrixXd& covariance_mm2) {
  const Eigen::Index n = position_mm.size();
  if (measurements_++ == 0) {
    mean_ = Eigen::VectorXd::Zero(2 * n);
    mean_.head(n) = position_mm;
    covariance_ = Eigen::MatrixXd::Zero(2 * n, 2 * n);
    covariance_.topLeftCorner(n, n) = covariance_mm2;
    covariance_.bottomRightCorner(n, n).diagonal().setConstant(kFirstSpeedMmPerS * kFirstSpeedMmPerS);
    time_s_ = time_s;
    return;
  }
  const State predicted = at(time_s);
  const Eigen::MatrixXd innovation = predicted.covariance.topLeftCorner(n, n) + covariance_mm2;
  const Eigen::MatrixXd gain = solve_symmetric(innovation, predicted.covariance.topRows(n)).transpose();  // P H' S^-1
  mean_ = predicted.mean + product(gain, position_mm - predicted.mean.head(n));
  covariance_ = predicted.covariance - product(gain, predicted.covariance.topRows(n));
  covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
  time_s_ = time_s;
}

Prediction ConstantVelocityKalman::predict(double time_s) const {
  const State state = at(time_s);
  const Eigen::Index n = state.mean.size() / 2;
  return {.position_mm = is_warm() ? state.mean.head(n) : mean_.head(n),
          .sigma_mm = state.covariance.diagonal().head(n).cwiseSqrt()};
}

}  // namespace isoshift
