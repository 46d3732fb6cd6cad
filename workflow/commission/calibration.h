#pragma once
// Whether the uncertainties that registrations gave hold what they say: a sigma should hold 68 % of the errors.

#include <optional>
#include <vector>

#include "setup/agreement.h"
#include "workflow/commission/outcome.h"
#include "workflow/commission/placed_sessions.h"

namespace isoshift {

struct Calibration {
  // How many errors lie within one and two of their sigmas. Unset: no error has a sigma. Counted are errors that are
  // independent, if sessions are:
  // - of moves, and of positions where imagers may put axes off, those of every session against the mean of all before
  //   it that determine the same axes and, where imagers may put axes off, have the same views and couch angle;
  // - of all other positions, those of every session.
  std::optional<Share> within_one_sigma, within_two_sigma;
  // The mean error of positions that imagers may put off together, on the worst axis, in its sigmas, and what that
  // hardly exceeds. Unset: there is none.
  std::optional<double> shared_sigmas, shared_sigmas_limit;
  // Fails if one sigma holds clearly fewer than 68.27 % or two than 95.45 %, or if shared_sigmas exceeds its limit.
  Outcome outcome = Outcome::kUntested;
};

Calibration calibration_of(const std::vector<Placed>& sessions, Known known);

}  // namespace isoshift
