#pragma once
// Online linear autoregression: the position one latency ahead as a weighted sum of the last positions of all axes, the
// weights learned by recursive least squares with forgetting.

#include <deque>

#include "registration/motion/predictor.h"

namespace isoshift {

class RecursiveLeastSquares final : public Predictor {
 public:
  explicit RecursiveLeastSquares(const PredictorOptions& options) : options_(options) {}

  Prediction predict(double time_s) const override;
  bool is_warm() const override;

  // For tests. A column per axis: the weights of the taps, newest first, with all axes of a tap together; then the
  // weight of a constant 1.
  const Eigen::MatrixXd& weights() const { return weights_; }

 protected:
  void take(double time_s, const Eigen::VectorXd& position_mm, const Eigen::MatrixXd& covariance_mm2) override;

 private:
  struct Sample {
    double time_s;
    Eigen::VectorXd position;  // from the first one
  };
  Eigen::VectorXd position_at(double time_s) const;
  std::optional<Eigen::VectorXd> regressors(double time_s) const;
  void learn(const Eigen::VectorXd& regressors, const Eigen::VectorXd& target);

  PredictorOptions options_;
  Eigen::VectorXd origin_;
  std::deque<Sample> samples_;       // as far back as taps and latency reach
  double learned_until_s_ = -1e300;  // moments from which a prediction has been learned
  int learned_ = 0;
  Eigen::MatrixXd weights_, inverse_;  // and the inverse of the regressors' weighted correlation
  double farthest_mm_ = 0.0;           // moved within one latency so far
};

}  // namespace isoshift
