#pragma once
// Whether a quantity that many sessions measured has changed over time.
//
// The sessions of one patient resemble each other, so that they count less than as many sessions of other patients. A
// change is therefore looked for twice, by least squares: in the means of the patients, and in the sessions less the
// means of their patients. Neither test (Student's t) depends on how much patients differ, and the two are independent.
//
// Two shapes of change are tested: a line, where x is the time, and a step, where x is 0 before a date and 1 from it
// on. Bonferroni's correction covers both tests, both shapes, all dates that were tried, and the series that are tested
// together. So of a hundred audits without any change at most about five call one.

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

namespace isoshift {

inline constexpr double kDriftAlarmRate = 0.05;  // of an audit in which nothing has changed
inline constexpr double kDaysOfSlope = 30.0;     // slopes are changes per this many days
inline constexpr std::size_t kLeastSessionsForDrift = 10, kLeastPatientsForDrift = 3;

// What one session measured.
struct Measurement {
  double day = 0.0;         // of the session
  std::size_t patient = 0;  // the same number for the sessions of one patient
  double value = 0.0;
};

enum class DriftShape { kLine, kStep };

struct Drift {
  double slope = 0.0;                    // per kDaysOfSlope,
  double slope_within = 0.0;             // half the width of its 95 % confidence interval (Student's t)
  DriftShape shape = DriftShape::kLine;  // which of the two fits better
  double p = 1.0;  // how often series without a change look as if they had one of this size, corrected as above
  double base = 0.0, change = 0.0;  // of the shape: `change` per day, or at the step
  double change_within = 0.0;       // half the width of its 95 % confidence interval, as if the date were known
  double begins = 0.0;              // the day from which a line counts its days, or of the step

  bool is_significant() const { return p < kDriftAlarmRate; }
  double at(double day) const;  // the value of the shape
};

// `together`: how many series are tested together. Nothing: there are fewer than kLeastSessionsForDrift sessions or
// kLeastPatientsForDrift patients, or all are of one time. Precondition: days increase.
std::optional<Drift> drift_of(std::span<const Measurement> measurements, std::size_t together);

// The days at which a step is tried: at most 9, none of which leaves fewer than 5 sessions or 2 patients on a side.
std::vector<double> step_days(std::span<const Measurement> measurements);

// All days of sessions between the neighbors of one of these days: where a step that fits best there may really be.
std::vector<double> days_near(std::span<const Measurement> measurements, const std::vector<double>& step_days,
                              double day);

}  // namespace isoshift
