#pragma once
// A Kalman filter whose target moves at constant velocity but for white acceleration noise.

#include "registration/motion/predictor.h"

namespace isoshift {

class ConstantVelocityKalman final : public Predictor {
 public:
  explicit ConstantVelocityKalman(const PredictorOptions& options) : acceleration_noise_(options.acceleration_noise) {}

  Prediction predict(double time_s) const override;
  bool is_warm() const override { return measurements_ > 1; }

  // Positions, then velocities; for tests.
  const Eigen::MatrixXd& covariance() const { return covariance_; }

 protected:
  void take(double time_s, const Eigen::VectorXd& position_mm, const Eigen::MatrixXd& covariance_mm2) override;

 private:
  struct State {
    Eigen::VectorXd mean;  // positions, then velocities
    Eigen::MatrixXd covariance;
  };
  State at(double time_s) const;

  double acceleration_noise_;
  double time_s_ = 0.0;
  int measurements_ = 0;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd covariance_;
};

}  // namespace isoshift
