#pragma once
// How well registrations find known positions and moves of a phantom: what AAPM TG-142, TG-179, TG-198 and MPPG 2.b ask
// of localization, as statistics per axis.

#include <Eigen/Geometry>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "setup/agreement.h"
#include "setup/setup_errors.h"
#include "setup/site_rules.h"
#include "workflow/commission/calibration.h"
#include "workflow/commission/known_poses.h"
#include "workflow/commission/outcome.h"
#include "workflow/results_below.h"

namespace isoshift {

struct AxisOfLocalization {
  std::optional<Agreement> errors;  // of moves, the bias's interval holds the first session's own error, too
  double largest = 0.0;             // of the errors' sizes
  std::optional<double> least_known, most_known;
  Outcome limit = Outcome::kUntested;  // no error beyond the site's limit
};

// Per axis: whether sessions that are far enough apart were found on the right side of each other.
using Polarities = std::array<Outcome, 6>;

struct Localization {
  Known known = Known::kReadOuts;
  std::string reference;       // the session against which moves are; empty: positions
  std::vector<Localized> all;  // positions, or moves against the reference
  std::array<AxisOfLocalization, 6> axes;
  std::map<std::string, Polarities> polarities;  // by patient position and beam: "HFS, kV"
  Calibration calibration;

  // Of all patient positions and beams together: failed if it failed in one, passed if it passed in one.
  Outcome polarity(std::size_t axis) const;
};

// Rejected results must not be among the sessions. `known_poses` is used unless the read-outs are. Throws Error naming
// a session that has no known pose, a known pose that has no session, and moves of a single session.
Localization localization_of(const std::vector<NamedResult>& sessions, Known known, const KnownPoses& known_poses,
                             const std::optional<LocalizationLimits>& limits);

}  // namespace isoshift
