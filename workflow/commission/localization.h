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
#include "workflow/commission/known_poses.h"
#include "workflow/results_below.h"

namespace isoshift {

// One position, or one move against the first session. Components are along and about the axes of IEC 61217 fixed, of
// the motion from the planned pose (positions) or from the first session's (moves).
struct Localized {
  std::string session;
  std::array<std::optional<double>, 6> known;  // unset: an angle that the table of known poses does not name
  ErrorComponents found{};
  // What the registration put beside the known pose: translation at the isocenter and rotation vector. Unset: the
  // X-rays do not determine this axis.
  std::array<std::optional<double>, 6> error, sigma;
};

enum class Outcome { kPassed, kFailed, kUntested };
std::string_view to_string(Outcome outcome);

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
  std::string reference;  // the session against which moves are; empty: positions
  std::vector<Localized> all;
  std::array<AxisOfLocalization, 6> axes;
  std::map<std::string, Polarities> polarities;  // by patient position and beam: "HFS, kV"
  // Of independent errors with a sigma: how many lie within one and two of it. Unset: none has. They are those of moves
  // of every session against the mean of all before it, or those of positions without what the imagers put off in all
  // sessions of the same views.
  std::optional<Share> within_one_sigma, within_two_sigma;
  // What the imagers put off in all positions of the same views, on the worst axis, in its sigmas, and what this seldom
  // exceeds. Unset: nothing is known of the imagers, or of the positions.
  std::optional<double> shared_sigmas;
  double shared_sigmas_limit = 0.0;
  // Fails if one sigma holds clearly fewer than 68.27 %, or two than 95.45 %, or if shared_sigmas exceeds its limit.
  Outcome sigma = Outcome::kUntested;

  // Of all patient positions and beams together: failed if it failed in one, passed if it passed in one.
  Outcome polarity(std::size_t axis) const;
};

// Rejected results must not be among the sessions. `known_poses` is used unless the read-outs are. Throws Error naming
// a session that has no known pose, a known pose that has no session, and moves of a single session.
Localization localization_of(const std::vector<NamedResult>& sessions, Known known, const KnownPoses& known_poses,
                             const std::optional<LocalizationLimits>& limits);

}  // namespace isoshift
