#include "geometry/motion_sample.h"

#include <algorithm>
#include <cmath>
#include <iterator>

namespace isoshift {

std::optional<Eigen::Vector3d> position_at(std::span<const MotionSample> trace, double time_s) {
  constexpr double kSameMomentS = 1e-6;
  const auto after = std::ranges::lower_bound(trace, time_s - kSameMomentS, {}, &MotionSample::time_s);
  if (after == trace.end()) return std::nullopt;
  if (std::abs(after->time_s - time_s) < kSameMomentS) return after->position_mm;
  if (after == trace.begin()) return std::nullopt;
  const MotionSample& before = *std::prev(after);
  const double share = (time_s - before.time_s) / (after->time_s - before.time_s);
  return before.position_mm + share * (after->position_mm - before.position_mm);
}

}  // namespace isoshift
