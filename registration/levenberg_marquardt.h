#pragma once
// Levenberg-Marquardt: a climb on models of second order, for objectives that know their derivatives. A model that a
// Gauss-Newton curvature bends is trusted within a radius (More, Lecture Notes in Mathematics 630, 1978).

#include <span>
#include <vector>

#include "registration/optimizer.h"

namespace isoshift {

// What maximize() does for OptimizerKind::kLevenbergMarquardt: several searches in step, each call of `models` with the
// next point of all that still run. The first trust-region radius is the initial step of every parameter.
std::vector<OptimizerResult> climb(const BatchModel& models, std::span<const OptimizerOptions> searches);

}  // namespace isoshift
