#include "phantom/breathing.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace isoshift {
namespace {

constexpr double kPeriodS = 4.0;
const Eigen::Vector3d kInhaledMm(1.2, -3.0, -12.0);

// From 0 to 1 and back, longer exhaled than inhaled, as Lujan et al., Med Phys 26, 1999, write it with n = 2.
double inhaled(double phase) { return std::pow(std::sin(std::numbers::pi * phase), 4); }

}  // namespace

Breathing::Breathing(BreathingOptions options, std::uint64_t seed) : options_(std::move(options)) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> vary(-1.0, 1.0);
  double begin_s = 0.0;
  while (begin_s <= options_.seconds) {
    breaths_.push_back({begin_s, kPeriodS * (1.0 + 0.12 * vary(random)), 1.0 + 0.15 * vary(random)});
    begin_s += breaths_.back().length_s;
  }
}

Eigen::Vector3d Breathing::displacement_mm(double time_s) const {
  if (options_.trace.size() > 1) {
    const std::vector<MotionSample>& trace = options_.trace;
    const double length_s = trace.back().time_s - trace.front().time_s;
    const double at_s = trace.front().time_s + std::fmod(time_s, length_s);
    return position_at(trace, at_s).value_or(trace.back().position_mm) - trace.front().position_mm;
  }
  if (breaths_.empty()) return Eigen::Vector3d::Zero();
  const auto next = std::ranges::upper_bound(breaths_, time_s, {}, &Breath::begin_s);
  const Breath& breath = *std::prev(next);
  return breath.depth * inhaled(std::clamp((time_s - breath.begin_s) / breath.length_s, 0.0, 1.0)) * kInhaledMm;
}

Eigen::Vector3d Breathing::phase_displacement_mm(double phase) { return inhaled(phase) * kInhaledMm; }

}  // namespace isoshift
