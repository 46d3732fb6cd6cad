#include "workflow/audit_setup/drift.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <set>

#include "base/distributions.h"

namespace isoshift {
namespace {

using Eigen::VectorXd;

// Of values about a fit, mm or degrees. Values that are all alike, such as the rotations of a couch that cannot rotate,
// have none but that of their rounding, which says nothing.
constexpr double kLeastSd = 1e-4;
constexpr double kDriftTail = 0.025;  // on each side of a 95 % interval

// y = base + change * x by least squares, for x and y without their means.
struct LineFit {
  double change = 0.0;
  double variance = 0.0;  // of the change
  double freedom = 0.0;

  static std::optional<LineFit> of(const VectorXd& x, const VectorXd& y, double freedom) {
    const double xx = x.squaredNorm();
    if (!(xx > 0.0) || freedom < 1.0) return std::nullopt;
    const double change = x.dot(y) / xx;
    const double scatter = std::max((y - change * x).squaredNorm() / freedom, kLeastSd * kLeastSd);
    return LineFit{.change = change, .variance = scatter / xx, .freedom = freedom};
  }
  double t() const { return change == 0.0 ? 0.0 : std::abs(change) / std::sqrt(variance); }
  double p() const { return 2.0 * students_t_tail(freedom, t()); }
};

// What the means of patients tell of a change, and what sessions tell within their patients: two independent answers.
struct ChangeFit {
  std::optional<LineFit> between, within;
  double base = 0.0, change = 0.0;  // both answers, weighted by what is known of each
  double change_within = 0.0;       // half the width of its 95 % confidence interval

  // That of the answer that says more, by Bonferroni's correction for two.
  double p() const {
    if (!between || !within) return between ? between->p() : within ? within->p() : 1.0;
    return std::min(1.0, 2.0 * std::min(between->p(), within->p()));
  }
};

// The series in columns.
class PatientSeries {
 public:
  explicit PatientSeries(std::span<const Measurement> measurements)
      : y_(static_cast<Eigen::Index>(measurements.size())), of_(measurements.size()) {
    std::map<std::size_t, std::size_t> numbers;
    for (std::size_t n = 0; n < measurements.size(); ++n) {
      y_[static_cast<Eigen::Index>(n)] = measurements[n].value;
      of_[n] = numbers.try_emplace(measurements[n].patient, numbers.size()).first->second;
    }
    counts_ = VectorXd::Zero(static_cast<Eigen::Index>(numbers.size()));
    for (const std::size_t patient : of_) ++counts_[static_cast<Eigen::Index>(patient)];
    y_means_ = means(y_);
  }

  ChangeFit fit(const VectorXd& x) const {
    const VectorXd x_means = means(x);
    const double patients = static_cast<double>(counts_.size()), sessions = static_cast<double>(y_.size());
    const VectorXd x_between = x_means.array() - x_means.mean(), y_between = y_means_.array() - y_means_.mean();
    ChangeFit fit{.between = LineFit::of(x_between, y_between, patients - 2.0),
                  .within = LineFit::of(x - spread(x_means), y_ - spread(y_means_), sessions - patients - 1.0)};
    double weights = 0.0, uncertainty = 0.0;
    for (const std::optional<LineFit>& one : {fit.between, fit.within}) {
      if (!one) continue;
      const double weight = 1.0 / one->variance;
      fit.change += weight * one->change;
      weights += weight;
      uncertainty += weight * weight / one->freedom;
    }
    if (weights > 0.0) {
      fit.change /= weights;
      // Satterthwaite's degrees of freedom of the weighted mean.
      fit.change_within = students_t_quantile(weights * weights / uncertainty, kDriftTail) / std::sqrt(weights);
    }
    fit.base = y_means_.mean() - fit.change * x_means.mean();
    return fit;
  }

 private:
  VectorXd means(const VectorXd& values) const {
    VectorXd sums = VectorXd::Zero(counts_.size());
    for (std::size_t n = 0; n < of_.size(); ++n)
      sums[static_cast<Eigen::Index>(of_[n])] += values[static_cast<Eigen::Index>(n)];
    return sums.cwiseQuotient(counts_);
  }

  // Of a value per patient, that of each session.
  VectorXd spread(const VectorXd& of_patients) const {
    VectorXd all(y_.size());
    for (std::size_t n = 0; n < of_.size(); ++n)
      all[static_cast<Eigen::Index>(n)] = of_patients[static_cast<Eigen::Index>(of_[n])];
    return all;
  }

  VectorXd y_;
  std::vector<std::size_t> of_;  // the patient of a session
  VectorXd counts_, y_means_;    // of a patient
};

VectorXd column(std::span<const Measurement> measurements, const std::function<double(double)>& of_day) {
  VectorXd x(static_cast<Eigen::Index>(measurements.size()));
  for (std::size_t n = 0; n < measurements.size(); ++n) x[static_cast<Eigen::Index>(n)] = of_day(measurements[n].day);
  return x;
}

}  // namespace

double Drift::at(double day) const {
  if (shape == DriftShape::kLine) return base + change * (day - begins);
  return base + (day >= begins ? change : 0.0);
}

std::vector<double> step_days(std::span<const Measurement> measurements) {
  constexpr std::size_t kMostDays = 9, kLeastSessions = 5, kLeastPatients = 2;
  const auto patients_in = [](std::span<const Measurement> some) {
    std::set<std::size_t> patients;
    for (const Measurement& one : some) patients.insert(one.patient);
    return patients.size();
  };
  std::vector<double> days;
  for (std::size_t n = 1; n <= kMostDays; ++n) {
    const double day = measurements[n * (measurements.size() - 1) / (kMostDays + 1)].day;
    const auto from = std::ranges::lower_bound(measurements, day, {}, &Measurement::day);
    const std::span before(measurements.begin(), from), after(from, measurements.end());
    const bool is_told = std::min(before.size(), after.size()) >= kLeastSessions &&
                         std::min(patients_in(before), patients_in(after)) >= kLeastPatients;
    if (is_told && (days.empty() || day > days.back())) days.push_back(day);
  }
  return days;
}

std::vector<double> days_near(std::span<const Measurement> measurements, const std::vector<double>& step_days,
                              double day) {
  const auto at = std::ranges::lower_bound(step_days, day);
  const double first = at == step_days.begin() ? *at : *std::prev(at);
  const double last = std::next(at) == step_days.end() ? *at : *std::next(at);
  std::vector<double> days;
  for (const Measurement& one : measurements)
    if (one.day >= first && one.day <= last && (days.empty() || one.day > days.back())) days.push_back(one.day);
  return days;
}

std::optional<Drift> drift_of(std::span<const Measurement> measurements, std::size_t together) {
  std::set<std::size_t> patients;
  for (const Measurement& one : measurements) patients.insert(one.patient);
  if (measurements.size() < kLeastSessionsForDrift || patients.size() < kLeastPatientsForDrift ||
      !(measurements.back().day > measurements.front().day))
    return std::nullopt;
  const PatientSeries series(measurements);
  const double first = measurements.front().day;
  const ChangeFit line = series.fit(column(measurements, [&](double day) { return day - first; }));
  Drift drift{.slope = kDaysOfSlope * line.change,
              .slope_within = kDaysOfSlope * line.change_within,
              .base = line.base,
              .change = line.change,
              .change_within = line.change_within,
              .begins = first};
  double best = line.p();
  const auto step_at = [&](double begins) {
    return series.fit(column(measurements, [&](double day) { return day >= begins ? 1.0 : 0.0; }));
  };
  const std::vector<double> days = step_days(measurements);
  std::optional<double> begins;
  for (const double day : days)
    if (const double p = static_cast<double>(days.size()) * step_at(day).p(); p < best) {
      best = p;
      begins = day;
    }
  if (begins) {
    const std::vector<double> near = days_near(measurements, days, *begins);
    drift.begins = *std::ranges::min_element(near, {}, [&](double day) { return step_at(day).p(); });
    const ChangeFit step = step_at(drift.begins);
    drift.shape = DriftShape::kStep;
    drift.base = step.base;
    drift.change = step.change;
    drift.change_within = step.change_within;
  }
  constexpr double kShapes = 2.0;
  drift.p = std::min(1.0, kShapes * static_cast<double>(together) * best);
  return drift;
}

}  // namespace isoshift
