#pragma once
// Filters that predict where a moving target will be when the beam reacts to an X-ray (docs/algorithms.md,
// "Following a moving target").
//
//   auto predictor = make_predictor(PredictorKind::kRls, {.latency_s = 0.3});
//   predictor->add(time_s, position_mm, covariance_mm2);
//   const Prediction soon = predictor->predict(time_s + 0.3);

#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isoshift {

struct Prediction {
  Eigen::VectorXd position_mm;
  std::optional<Eigen::VectorXd> sigma_mm;  // one standard deviation per axis, of filters that know it
};

// One interface for any dimension and for sampling at any moments.
class Predictor {
 public:
  virtual ~Predictor() = default;

  // Takes a measurement that is later than all before. Its covariance says how well each direction was measured, and is
  // huge along a direction that was not measured. Throws UsageError for another dimension, numbers that are not finite,
  // or a time that does not advance.
  void add(double time_s, const Eigen::VectorXd& position_mm, const Eigen::MatrixXd& covariance_mm2);

  // At a moment that is not before the last measurement. Precondition: there is a measurement.
  virtual Prediction predict(double time_s) const = 0;

  // Whether the predictor has seen enough measurements; until then it answers as hold-last does.
  virtual bool is_warm() const = 0;

 protected:
  virtual void take(double time_s, const Eigen::VectorXd& position_mm, const Eigen::MatrixXd& covariance_mm2) = 0;

 private:
  std::optional<double> last_time_s_;
  Eigen::Index dimension_ = 0;
};

enum class PredictorKind {
  kHoldLast,  // the last position: the baseline
  kKalman,    // constant velocity
  kRls,       // online linear autoregression by recursive least squares
  kModel,     // the founding paper's: a periodic trajectory predicts, measurements correct it
};
inline constexpr std::array kPredictorKinds = {PredictorKind::kHoldLast, PredictorKind::kKalman, PredictorKind::kRls,
                                               PredictorKind::kModel};
std::string_view to_string(PredictorKind kind);
std::optional<PredictorKind> predictor_kind_from(std::string_view name);
std::vector<std::string> predictor_names();  // all of them

// The constants were chosen leaving one session out each time (docs/motion.md).
struct PredictorOptions {
  double latency_s = 0.3;  // kRls learns to predict over this time; more is not extrapolated

  // kKalman: white acceleration noise, mm^2/s^3. Against a measurement noise of 0.3 mm.
  double acceleration_noise = 400.0;

  // kRls.
  int taps = 5;                // positions looked back at
  double tap_s = 0.1;          // the time between them
  double forgetting = 0.9995;  // per measurement
  double regularization = 1.0;

  // kModel: displacements at evenly spaced phases of a cycle, such as those of a 4D CT. Empty: learned from the first
  // breaths.
  std::vector<Eigen::VectorXd> phases_mm;
  double phase_noise = 1.0;    // of the state, per square root of a second: rad,
  double speed_noise = 0.5;    // rad/s,
  double depth_noise = 0.3;    // share of the trajectory,
  double offset_noise = 10.0;  // mm
  double learning_s = 20.0;    // of first breaths: to learn the trajectory, or to find period and phase in one given
};

std::unique_ptr<Predictor> make_predictor(PredictorKind kind, const PredictorOptions& options);

}  // namespace isoshift
