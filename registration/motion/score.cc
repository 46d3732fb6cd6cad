#include "registration/motion/score.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/median.h"

namespace isoshift {

std::vector<MotionSample> resampled(std::span<const MotionSample> trace, double rate_hz) {
  if (trace.size() < 2) throw UsageError("a trace needs at least two samples");
  std::vector<MotionSample> even;
  std::size_t next = 1;
  const double begin_s = trace.front().time_s;
  for (int n = 0;; ++n) {
    const double time_s = begin_s + n / rate_hz;
    if (time_s > trace.back().time_s) break;
    while (trace[next].time_s < time_s && next + 1 < trace.size()) ++next;
    const MotionSample &a = trace[next - 1], &b = trace[next];
    if (!(b.time_s > a.time_s))
      throw UsageError(fmt::format("the times of a trace do not increase: {} s after {} s", b.time_s, a.time_s));
    const double share = (time_s - a.time_s) / (b.time_s - a.time_s);
    even.push_back({time_s, a.position_mm + share * (b.position_mm - a.position_mm)});
  }
  return even;
}

PredictionScore score_of(const std::vector<double>& errors_mm) {
  PredictionScore result{.samples = errors_mm.size()};
  if (errors_mm.empty()) return result;
  double squares = 0.0;
  for (const double error_mm : errors_mm) squares += error_mm * error_mm;
  result.median_mm = quantile(errors_mm, 0.5);
  result.rmse_mm = std::sqrt(squares / static_cast<double>(errors_mm.size()));
  result.p95_mm = quantile(errors_mm, 0.95);
  result.max_mm = std::ranges::max(errors_mm);
  return result;
}

PredictionScore score(PredictorKind kind, const PredictorOptions& options, std::span<const MotionSample> trace,
                      double latency_s, const ScoreProtocol& protocol) {
  const std::vector<MotionSample> samples = resampled(trace, protocol.rate_hz);
  const double length_s = samples.back().time_s - samples.front().time_s;
  const double scored_after_s =
      samples.front().time_s + (length_s < protocol.short_trace_s ? protocol.short_training_s : protocol.training_s);
  PredictorOptions with_latency = options;
  // The youngest sample known is on the grid: that far it has to predict.
  with_latency.latency_s = std::ceil(latency_s * protocol.rate_hz - 1e-6) / protocol.rate_hz;
  const std::unique_ptr<Predictor> predictor = make_predictor(kind, with_latency);
  const Eigen::Matrix3d covariance =
      protocol.measurement_sigma_mm * protocol.measurement_sigma_mm * Eigen::Matrix3d::Identity();
  std::vector<double> errors_mm;
  std::size_t known = 0;
  constexpr double kSameMomentS = 1e-6;
  for (const MotionSample& sample : samples) {
    for (; known < samples.size() && samples[known].time_s <= sample.time_s - latency_s + kSameMomentS; ++known)
      predictor->add(samples[known].time_s, samples[known].position_mm, covariance);
    if (known == 0 || sample.time_s <= scored_after_s) continue;
    errors_mm.push_back((predictor->predict(sample.time_s).position_mm - sample.position_mm).norm());
  }
  return score_of(errors_mm);
}

}  // namespace isoshift
