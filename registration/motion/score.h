#pragma once
// How well predictors do on recorded motion.

#include <span>
#include <vector>

#include "geometry/motion_sample.h"
#include "registration/motion/predictor.h"

namespace isoshift {

struct ScoreProtocol {
  double rate_hz = 10.0;           // samples are brought to this rate, linearly, from the first one on
  double training_s = 60.0;        // at the beginning, not scored
  double short_training_s = 40.0;  // of traces shorter than short_trace_s
  double short_trace_s = 90.0;
  double measurement_sigma_mm = 0.3;  // what the filters are told of the samples
};

// Of 3D distances, such as those between prediction and sample; 0 where there are none.
struct PredictionScore {
  double median_mm = 0.0, rmse_mm = 0.0, p95_mm = 0.0, max_mm = 0.0;
  std::size_t samples = 0;
};
PredictionScore score_of(const std::vector<double>& errors_mm);

// On an even grid. Throws UsageError for fewer than two samples or times that do not increase.
std::vector<MotionSample> resampled(std::span<const MotionSample> trace, double rate_hz);

// Every sample after the training is predicted from those at least `latency_s` older, as they come in.
PredictionScore score(PredictorKind kind, const PredictorOptions& options, std::span<const MotionSample> trace,
                      double latency_s, const ScoreProtocol& protocol);

}  // namespace isoshift
