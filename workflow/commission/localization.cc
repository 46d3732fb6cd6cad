#include "workflow/commission/localization.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "geometry/motion_axes.h"
#include "geometry/rotation.h"
#include "workflow/commission/placed_sessions.h"

namespace isoshift {
namespace {

Localized localized(const std::string& session, const Compared& compared, const Vector6d& error) {
  Localized one{.session = session, .known = {}, .found = components_of(compared.found), .error = {}, .sigma = {}};
  const ErrorComponents known = components_of(compared.known);
  for (std::size_t axis = 0; axis < 6; ++axis) {
    if (compared.are_angles_known || !is_rotation(axis)) one.known[axis] = known[axis];
    if (!compared.are_determined[axis]) continue;
    const auto n = static_cast<Eigen::Index>(axis);
    const double unit = is_rotation(axis) ? deg_from_rad(1.0) : 1.0;
    one.error[axis] = unit * error[n];
    if (const double variance = compared.covariance(n, n); variance > 0.0) one.sigma[axis] = unit * std::sqrt(variance);
  }
  return one;
}

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
      const Localized one = localized("", move, move.error());
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

// Errors that are independent of each other, to count, and what sessions share.
struct IndependentErrors {
  std::vector<Localized> counted;
  std::vector<double> shared;  // in its sigmas, once per axis
};

// Moves: every session against the mean of all before it. These differences are independent where the sessions'
// uncertainties are equal (Helmert's contrasts); moves that share the first session are not.
void add_contrasts(const std::vector<const Placed*>& sessions, IndependentErrors& errors) {
  for (std::size_t now = 1; now < sessions.size(); ++now) {
    const auto before = static_cast<double>(now);
    Compared mean = compared(*sessions[now]);
    Vector6d error = Vector6d::Zero();
    CarriedErrors carried;
    carried.add(*sessions[now], Matrix6d::Identity());
    for (std::size_t n = 0; n < now; ++n) {
      const Compared move = compared(*sessions[n], *sessions[now]);
      error += move.error() / before;
      carried.add(*sessions[n], -carried_by(move.found) / before);
      for (std::size_t axis = 0; axis < 6; ++axis)
        mean.are_determined[axis] = mean.are_determined[axis] && move.are_determined[axis];
    }
    mean.covariance = carried.covariance();
    errors.counted.push_back(localized(sessions[now]->name, mean, error));
  }
}

// Positions seen by the same views hold the same error of the imagers. Its most probable value, from the sessions' mean
// and what is expected of the imagers, is taken out of every session, and is tested once.
void add_positions(const std::vector<const Placed*>& sessions, IndependentErrors& errors) {
  const auto count = static_cast<double>(sessions.size());
  std::vector<Localized> all;
  all.reserve(sessions.size());
  for (const Placed* session : sessions)
    all.push_back(localized(session->name, compared(*session), compared(*session).error()));
  for (std::size_t axis = 0; axis < 6; ++axis) {
    if (!std::ranges::all_of(all, [axis](const Localized& one) { return one.error[axis] && one.sigma[axis]; }))
      continue;
    const double unit = is_rotation(axis) ? deg_from_rad(1.0) : 1.0;
    const auto n = static_cast<Eigen::Index>(axis);
    const double by_imagers = unit * unit * sessions.front()->by_imagers(n, n);  // variances
    if (!(by_imagers > 0.0)) continue;
    double mean = 0.0, by_session = 0.0;
    for (const Localized& one : all) {
      mean += *one.error[axis] / count;
      by_session += std::max(0.0, *one.sigma[axis] * *one.sigma[axis] - by_imagers) / count;
    }
    const double of_mean = by_imagers + by_session / count, share = by_imagers / of_mean;
    errors.shared.push_back(mean / std::sqrt(of_mean));
    for (Localized& one : all) {
      const double own = std::max(0.0, *one.sigma[axis] * *one.sigma[axis] - by_imagers);
      one.error[axis] = *one.error[axis] - share * mean;
      one.sigma[axis] = std::sqrt(own - (2.0 * share * own - share * share * by_session) / count +
                                  (1.0 - share) * (1.0 - share) * by_imagers);
    }
  }
  errors.counted.insert(errors.counted.end(), all.begin(), all.end());
}

IndependentErrors independent_errors(const std::vector<Placed>& sessions, Known known) {
  std::vector<std::vector<const Placed*>> groups;  // that determine the same axes; positions also of the same views
  for (const Placed& session : sessions) {
    const auto group = std::ranges::find_if(groups, [&](const std::vector<const Placed*>& alike) {
      return alike.front()->are_determined == session.are_determined &&
             (known != Known::kPositions || have_same_views(*alike.front(), session));
    });
    if (group == groups.end())
      groups.push_back({&session});
    else
      group->push_back(&session);
  }
  IndependentErrors errors;
  for (const std::vector<const Placed*>& alike : groups)
    (known == Known::kPositions ? add_positions : add_contrasts)(alike, errors);
  return errors;
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

void calibrate(Localization& localization, const IndependentErrors& errors) {
  constexpr double kOneSigma = 0.6827, kTwoSigma = 0.9545;
  std::size_t total = 0, within_one = 0, within_two = 0;
  for (const Localized& one : errors.counted)
    for (std::size_t axis = 0; axis < 6; ++axis) {
      if (!one.error[axis] || !one.sigma[axis]) continue;
      ++total;
      within_one += std::abs(*one.error[axis]) <= *one.sigma[axis] ? 1U : 0U;
      within_two += std::abs(*one.error[axis]) <= 2.0 * *one.sigma[axis] ? 1U : 0U;
    }
  if (total == 0) return;
  localization.within_one_sigma = share_of(within_one, total);
  localization.within_two_sigma = share_of(within_two, total);
  bool holds = localization.within_one_sigma->high >= kOneSigma && localization.within_two_sigma->high >= kTwoSigma;
  if (!errors.shared.empty()) {
    localization.shared_sigmas =
        std::abs(*std::ranges::max_element(errors.shared, {}, [](double z) { return std::abs(z); }));
    localization.shared_sigmas_limit = sigmas_hardly_exceeded(errors.shared.size());
    holds = holds && *localization.shared_sigmas <= localization.shared_sigmas_limit;
  }
  localization.sigma = holds ? Outcome::kPassed : Outcome::kFailed;
}

}  // namespace

std::string_view to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::kPassed: return "passed";
    case Outcome::kFailed: return "FAILED";
    case Outcome::kUntested: return "untested";
  }
  return "";
}

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
    for (const Placed& session : all)
      localization.all.push_back(localized(session.name, compared(session), compared(session).error()));
  } else {
    localization.reference = all.front().name;
    for (std::size_t n = 1; n < all.size(); ++n) {
      const Compared move = compared(all.front(), all[n]);
      localization.all.push_back(localized(all[n].name, move, move.error()));
    }
  }
  for (std::size_t axis = 0; axis < localization.axes.size(); ++axis)
    localization.axes[axis] = axis_of(localization, axis, limits);
  localization.polarities = polarities_of(all);
  calibrate(localization, independent_errors(all, known));
  return localization;
}

}  // namespace isoshift
