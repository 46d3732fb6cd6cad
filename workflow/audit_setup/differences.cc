#include "workflow/audit_setup/differences.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "base/distributions.h"
#include "base/median.h"

namespace isoshift {
namespace {

using Level = std::function<double(double day)>;

// Median and MAD give a standard deviation with 37 % of the efficiency of the usual one, and so with that share of its
// degrees of freedom (Rousseeuw and Croux, J Am Stat Assoc 88, 1993).
constexpr double kNormalMad = 1.4826, kMadEfficiency = 0.37;
// Shifts are rounded when they are shown and typed: the scatter is never taken to be less.
constexpr double kLeastScatter = 0.1;  // mm, degrees
constexpr std::size_t kLeastSessions = 5;

std::vector<Measurement> known_on(std::span<const SessionDifference> sessions, std::size_t axis,
                                  const DifferencesFound* without_outliers_of) {
  std::vector<Measurement> known;
  for (std::size_t n = 0; n < sessions.size(); ++n)
    if (sessions[n].difference[axis] && !(without_outliers_of != nullptr && without_outliers_of->is_outlier(n)))
      known.push_back({.day = sessions[n].day, .patient = sessions[n].patient, .value = *sessions[n].difference[axis]});
  return known;
}

double median_value(std::span<const Measurement> some) {
  std::vector<double> values;
  for (const Measurement& one : some) values.push_back(one.value);
  return median(std::move(values));
}

// A line that a quarter of wrong values cannot turn: the median of the slopes between sessions that lie half of all
// sessions apart (Theil's incomplete method).
Level robust_line(std::span<const Measurement> known) {
  std::vector<double> slopes, bases;
  const std::size_t half = known.size() / 2;
  for (std::size_t n = 0; n + half < known.size(); ++n)
    if (const double days = known[n + half].day - known[n].day; days > 0.0)
      slopes.push_back((known[n + half].value - known[n].value) / days);
  const double slope = slopes.empty() ? 0.0 : median(std::move(slopes));
  for (const Measurement& one : known) bases.push_back(one.value - slope * one.day);
  return [slope, base = median(std::move(bases))](double day) { return base + slope * day; };
}

Level robust_step(std::span<const Measurement> known, double begins) {
  const auto from = std::ranges::lower_bound(known, begins, {}, &Measurement::day);
  return [begins, before = median_value({known.begin(), from}), after = median_value({from, known.end()})](double day) {
    return day >= begins ? after : before;
  };
}

// Before anything is known of outliers and drift: the line or the step that leaves least.
Level robust_level(std::span<const Measurement> known) {
  const auto left = [&](const Level& level) {
    double sum = 0.0;
    for (const Measurement& one : known) sum += std::abs(one.value - level(one.day));
    return sum;
  };
  const auto left_of_step = [&](double begins) { return left(robust_step(known, begins)); };
  Level line = robust_line(known);
  const std::vector<double> days = step_days(known);
  if (days.empty()) return line;
  const std::vector<double> near = days_near(known, days, *std::ranges::min_element(days, {}, left_of_step));
  const Level step = robust_step(known, *std::ranges::min_element(near, {}, left_of_step));
  return left(step) < left(line) ? step : line;
}

// Finds the outliers of one axis against its level.
void call_outliers(std::span<const SessionDifference> sessions, std::size_t axis, const Level& level,
                   DifferencesFound& found) {
  std::vector<double> off, sigmas;
  for (const SessionDifference& session : sessions) {
    if (!session.difference[axis]) continue;
    off.push_back(std::abs(*session.difference[axis] - level(session.day)));
    if (session.sigma[axis]) sigmas.push_back(*session.sigma[axis]);
  }
  const double usual_sigma = sigmas.empty() ? 0.0 : median(sigmas);
  const double scatter = std::max(kLeastScatter, kNormalMad * median(off));
  found.axes[axis].scatter = scatter;
  for (std::size_t n = 0; n < sessions.size(); ++n) {
    if (!sessions[n].difference[axis]) continue;
    // The scatter holds what the registrations usually add; where this one is less sure, it may add more.
    const double sigma = sessions[n].sigma[axis].value_or(usual_sigma);
    const double more = std::max(0.0, sigma * sigma - usual_sigma * usual_sigma);
    found.level[n][axis] = level(sessions[n].day);
    found.deviation[n][axis] = std::sqrt(scatter * scatter + more);
    if (std::abs(*sessions[n].difference[axis] - *found.level[n][axis]) > found.threshold * *found.deviation[n][axis])
      found.outlying[n].push_back(axis);
  }
}

// So that all differences together are expected to give kFalseOutliers outliers, if they are normal.
double threshold_for(const DifferencesFound& found) {
  std::size_t values = 0, fewest = 0;
  for (const DifferencesFound::Axis& axis : found.axes) {
    if (axis.count < kLeastSessions) continue;
    values += axis.count;
    fewest = fewest == 0 ? axis.count : std::min(fewest, axis.count);
  }
  if (values == 0) return 0.0;
  return students_t_quantile(kMadEfficiency * static_cast<double>(fewest - 1),
                             0.5 * kFalseOutliers / static_cast<double>(values));
}

}  // namespace

DifferencesFound find_in_differences(std::span<const SessionDifference> sessions) {
  DifferencesFound found;
  std::array<Level, 6> levels;
  for (std::size_t axis = 0; axis < levels.size(); ++axis) {
    const std::vector<Measurement> known = known_on(sessions, axis, nullptr);
    found.axes[axis].count = known.size();
    if (known.size() >= kLeastSessions) levels[axis] = robust_level(known);
  }
  found.threshold = threshold_for(found);
  found.outlying.resize(sessions.size());
  constexpr int kMostRounds = 10;  // what is called changes in the first two or three
  for (int round = 0; round < kMostRounds; ++round) {
    const auto called = std::exchange(found.outlying, std::vector<std::vector<std::size_t>>(sessions.size()));
    found.level.assign(sessions.size(), {});
    found.deviation.assign(sessions.size(), {});
    for (std::size_t axis = 0; axis < levels.size(); ++axis)
      if (levels[axis]) call_outliers(sessions, axis, levels[axis], found);
    if (round > 0 && found.outlying == called) break;
    for (std::size_t axis = 0; axis < levels.size(); ++axis) {
      if (!levels[axis]) continue;
      const std::vector<Measurement> known = known_on(sessions, axis, &found);
      found.axes[axis].drift = drift_of(known, levels.size());
      if (const auto& drift = found.axes[axis].drift; drift && drift->is_significant())
        levels[axis] = [drift](double day) { return drift->at(day); };
      else if (!known.empty())
        levels[axis] = [level = median_value(known)](double) { return level; };
    }
  }
  return found;
}

}  // namespace isoshift
