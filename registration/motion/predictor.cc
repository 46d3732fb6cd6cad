#include "registration/motion/predictor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "registration/motion/kalman.h"
#include "registration/motion/periodic_model.h"
#include "registration/motion/rls.h"

namespace isoshift {
namespace {

class HoldLast final : public Predictor {
 public:
  Prediction predict(double) const override { return {.position_mm = last_, .sigma_mm = std::nullopt}; }
  bool is_warm() const override { return last_.size() > 0; }

 protected:
  void take(double, const Eigen::VectorXd& position_mm, const Eigen::MatrixXd&) override { last_ = position_mm; }

 private:
  Eigen::VectorXd last_;
};

}  // namespace

void Predictor::add(double time_s, const Eigen::VectorXd& position_mm, const Eigen::MatrixXd& covariance_mm2) {
  if (!last_time_s_) dimension_ = position_mm.size();
  if (position_mm.size() != dimension_ || covariance_mm2.rows() != dimension_ || covariance_mm2.cols() != dimension_)
    throw UsageError(fmt::format("a position of {} numbers after one of {}", position_mm.size(), dimension_));
  if (!position_mm.allFinite() || !covariance_mm2.allFinite() || !std::isfinite(time_s))
    throw UsageError("a measured position is not finite");
  if (last_time_s_ && time_s <= *last_time_s_)
    throw UsageError(fmt::format("a position measured at {} s after one at {} s", time_s, *last_time_s_));
  last_time_s_ = time_s;
  take(time_s, position_mm, covariance_mm2);
}

std::string_view to_string(PredictorKind kind) {
  switch (kind) {
    case PredictorKind::kHoldLast: return "hold-last";
    case PredictorKind::kKalman: return "kalman";
    case PredictorKind::kRls: return "rls";
    case PredictorKind::kModel: return "model";
  }
  return "";
}

std::optional<PredictorKind> predictor_kind_from(std::string_view name) {
  const auto found = std::ranges::find(kPredictorKinds, name, [](PredictorKind kind) { return to_string(kind); });
  return found == kPredictorKinds.end() ? std::nullopt : std::optional(*found);
}

std::vector<std::string> predictor_names() {
  std::vector<std::string> names(kPredictorKinds.size());
  std::ranges::transform(kPredictorKinds, names.begin(),
                         [](PredictorKind kind) { return std::string(to_string(kind)); });
  return names;
}

std::unique_ptr<Predictor> make_predictor(PredictorKind kind, const PredictorOptions& options) {
  switch (kind) {
    case PredictorKind::kHoldLast: return std::make_unique<HoldLast>();
    case PredictorKind::kKalman: return std::make_unique<ConstantVelocityKalman>(options);
    case PredictorKind::kRls: return std::make_unique<RecursiveLeastSquares>(options);
    case PredictorKind::kModel: return std::make_unique<PeriodicModelKalman>(options);
  }
  return nullptr;
}

}  // namespace isoshift
