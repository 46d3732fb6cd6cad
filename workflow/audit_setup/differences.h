#pragma once
// Differences between two ways of finding a couch shift, over many sessions: which lie outside what the other sessions
// let expect, and whether they drift.
//
// A drift must not make outliers, nor an outlier a drift: differences are judged against a level that may change over
// time, and the level is fitted without the sessions that were called. Both are repeated until they agree.

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "workflow/audit_setup/couch_axes.h"
#include "workflow/audit_setup/drift.h"

namespace isoshift {

// What one session says.
struct SessionDifference {
  double day = 0.0;
  std::size_t patient = 0;  // the same number for the sessions of one patient
  CouchAxes difference;
  CouchAxes sigma;  // of the registration, where it is known
};

struct DifferencesFound {
  struct Axis {
    std::optional<Drift> drift;  // without the outliers; nothing: too few sessions or patients
    double scatter = 0.0;        // robust standard deviation about the level
    std::size_t count = 0;       // known differences
  };
  std::array<Axis, 6> axes;
  double threshold = 0.0;                   // outliers lie farther from the level than this many standard deviations
  std::vector<CouchAxes> level, deviation;  // per session: what was expected, and the standard deviation about it
  std::vector<std::vector<std::size_t>> outlying;  // per session: the axes on which it is an outlier

  bool is_outlier(std::size_t session) const { return !outlying[session].empty(); }
};

// How many sessions without any error an audit is expected to call: one in twenty audits calls one.
inline constexpr double kFalseOutliers = 0.05;

// Precondition: days increase.
DifferencesFound find_in_differences(std::span<const SessionDifference> sessions);

}  // namespace isoshift
