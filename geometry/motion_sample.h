#pragma once
// Where a target was at a moment.

#include <Eigen/Core>
#include <optional>
#include <span>

namespace isoshift {

struct MotionSample {
  double time_s = 0.0;
  Eigen::Vector3d position_mm = Eigen::Vector3d::Zero();
};

// The position at a time, interpolated linearly between the samples before and after it; nothing outside the trace.
// Precondition: times increase.
std::optional<Eigen::Vector3d> position_at(std::span<const MotionSample> trace, double time_s);

}  // namespace isoshift
