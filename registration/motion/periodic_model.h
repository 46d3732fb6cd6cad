#pragma once
// The founding paper's filter: a patient's own periodic trajectory predicts, measurements correct its phase, its speed,
// its depth and where it lies (an extended Kalman filter).

#include "registration/motion/predictor.h"

namespace isoshift {

// A closed trajectory against the phase (0 to 2 pi), as a Fourier series, with mean 0.
class PeriodicTrajectory {
 public:
  // From displacements at evenly spaced phases, the first at 0: at least 4.
  explicit PeriodicTrajectory(const std::vector<Eigen::VectorXd>& phases_mm);

  // From measurements over some cycles of that period, the phase being 0 at time 0.
  PeriodicTrajectory(const std::vector<double>& times_s, const std::vector<Eigen::VectorXd>& positions_mm,
                     double period_s);

  Eigen::VectorXd at(double phase_rad) const;
  Eigen::VectorXd derivative_at(double phase_rad) const;  // mm per radian

 private:
  Eigen::MatrixXd coefficients_;  // per axis a column: cosine and sine of each harmonic
};

// The period of breathing in measurements, by autocorrelation between 1.5 and 10 s; nothing where none repeats.
std::optional<double> period_of(const std::vector<double>& times_s, const std::vector<Eigen::VectorXd>& positions_mm);

class PeriodicModelKalman final : public Predictor {
 public:
  explicit PeriodicModelKalman(const PredictorOptions& options) : options_(options) {}

  Prediction predict(double time_s) const override;
  bool is_warm() const override { return trajectory_.has_value(); }

 protected:
  void take(double time_s, const Eigen::VectorXd& position_mm, const Eigen::MatrixXd& covariance_mm2) override;

 private:
  // State: phase, its speed, depth (1: as the trajectory), offset per axis.
  void start(double time_s);
  void advance(double dt, Eigen::VectorXd& mean, Eigen::MatrixXd& covariance) const;
  void correct(const Eigen::VectorXd& position_mm, const Eigen::MatrixXd& covariance_mm2);
  Eigen::MatrixXd measured_from_state(const Eigen::VectorXd& mean) const;

  PredictorOptions options_;
  std::vector<double> times_s_;  // until it is warm
  std::vector<Eigen::VectorXd> positions_mm_;
  Eigen::VectorXd last_mm_;
  std::optional<PeriodicTrajectory> trajectory_;
  double time_s_ = 0.0;
  Eigen::VectorXd mean_;
  Eigen::MatrixXd covariance_;
};

}  // namespace isoshift
