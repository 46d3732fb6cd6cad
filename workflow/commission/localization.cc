#include "workflow/commission/localization.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "geometry/motion_axes.h"
#include "workflow/commission/placed_sessions.h"

namespace isoshift {
namespace {

// Sessions and known poses name each other.
void check_names(const std::vector<NamedResult>& sessions, const KnownPoses& poses) {
  for (const NamedResult& session : sessions)
    if (!poses.by_session.contains(session.name))
      throw Error(fmt::format("session {} has no line in the table of known poses", session.name));
  for (const auto& [name, unused] : poses.by_session)
    if (std::ranges::find(sessions, name, &NamedResult::name) == sessions.end())
      throw Error(fmt::format("the table of known poses names session {}, of which there is no result to use", name));
}

// Between all sessions of one patient position and beam: a bias that they share says nothing about a sign.
std::map<std::string, Polarities> polarities_of(const std::vector<Placed>& sessions) {
  constexpr double kLeastMove = 1.0;  // mm or degrees
  constexpr double kTurnDeg = 360.0;
  constexpr double kLeastSigmas = 10.0;  // half a move that is as long is five sigma off
  std::map<std::string, Polarities> polarities;
  for (const Placed& session : sessions) polarities[session.condition].fill(Outcome::kUntested);
  for (std::size_t after = 1; after < sessions.size(); ++after)
    for (std::size_t before = 0; before < after; ++before) {
      if (sessions[before].condition != sessions[after].condition) continue;
      const Compared move = compared(sessions[before], sessions[after]);
      const Localized one = localized("", move);
      Polarities& polarity = polarities[sessions[after].condition];
      for (std::size_t axis = 0; axis < 6; ++axis) {
        const double least = std::max(kLeastMove, kLeastSigmas * one.sigma[axis].value_or(0.0));
        const double known = one.known[axis].value_or(0.0);
        if (!one.error[axis] || std::abs(known) < least || polarity[axis] == Outcome::kFailed) continue;
        // Half a turn is known as 180 or -180 degrees, and found beyond either.
        double off = one.found[axis] - known;
        if (is_rotation(axis)) off = std::remainder(off, kTurnDeg);
        const double found_by_known = 1.0 + off / known;
        polarity[axis] = found_by_known < 0.5 || found_by_known > 1.5 ? Outcome::kFailed : Outcome::kPassed;
      }
    }
  return polarities;
}

AxisOfLocalization axis_of(const Localization& localization, std::size_t axis,
                           const std::optional<LocalizationLimits>& limits) {
  AxisOfLocalization result;
  std::vector<double> errors;
  for (const Localized& one : localization.all) {
    if (one.error[axis]) errors.push_back(*one.error[axis]);
    if (!one.known[axis]) continue;
    // Moves begin at 0.
    const double first = localization.known == Known::kPositions ? *one.known[axis] : 0.0;
    result.least_known = std::min(result.least_known.value_or(first), *one.known[axis]);
    result.most_known = std::max(result.most_known.value_or(first), *one.known[axis]);
  }
  if (errors.empty()) return result;
  for (const double error : errors) result.largest = std::max(result.largest, std::abs(error));
  result.errors = agreement_of(errors);
  // All moves begin at one session, whose own error does not average out: 1/n becomes 1/n + 1.
  if (localization.known != Known::kPositions && result.errors->bias_within)
    *result.errors->bias_within *= std::sqrt(static_cast<double>(errors.size()) + 1.0);
  if (limits) {
    const double limit = is_rotation(axis) ? limits->rotation_deg : limits->translation_mm;
    result.limit = result.largest <= limit ? Outcome::kPassed : Outcome::kFailed;
  }
  return result;
}

}  // namespace

Outcome Localization::polarity(std::size_t axis) const {
  Outcome outcome = Outcome::kUntested;
  for (const auto& [condition, polarity] : polarities) {
    if (polarity[axis] == Outcome::kFailed) return Outcome::kFailed;
    if (polarity[axis] == Outcome::kPassed) outcome = Outcome::kPassed;
  }
  return outcome;
}

Localization localization_of(const std::vector<NamedResult>& sessions, Known known, const KnownPoses& known_poses,
                             const std::optional<LocalizationLimits>& limits) {
  if (known != Known::kReadOuts) check_names(sessions, known_poses);
  if (known != Known::kPositions && sessions.size() < 2)
    throw Error("a move needs two sessions whose results can be used. Where the phantom lay: --positions FILE.csv");
  const std::vector<Placed> all = placed(sessions, known, known_poses);
  Localization localization{.known = known};
  if (known == Known::kPositions) {
    for (const Placed& session : all) localization.all.push_back(localized(session.name, compared(session)));
  } else {
    localization.reference = all.front().name;
    for (std::size_t n = 1; n < all.size(); ++n)
      localization.all.push_back(localized(all[n].name, compared(all.front(), all[n])));
  }
  for (std::size_t axis = 0; axis < localization.axes.size(); ++axis)
    localization.axes[axis] = axis_of(localization, axis, limits);
  localization.polarities = polarities_of(all);
  localization.calibration = calibration_of(all, known);
  return localization;
}

}  // namespace isoshift
