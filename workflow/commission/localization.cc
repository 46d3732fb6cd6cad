#include "workflow/commission/localization.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "base/error.h"
#include "geometry/motion_axes.h"
#include "geometry/rotation.h"
#include "setup/shown_shift.h"

namespace isoshift {
namespace {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

Eigen::Isometry3d found_pose(const SetupResult& session) {
  const auto position = patient_position_from(session.patient_position);
  if (!position) throw Error(fmt::format("patient position \"{}\" is none of DICOM's", session.patient_position));
  return session.setup_error * planned_room_from_patient(*position, session.table, session.isocenter_patient_mm);
}

std::array<bool, 6> determined_axes(const SetupResult& session) {
  std::array<bool, 6> are_determined{};
  const ShownShift shown = shown_shift(session);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    are_determined[axis] = shown.setup_error_mm[axis].has_value();
    are_determined[axis + 3] = !session.translation_only && session.unobservable_room.empty();
  }
  return are_determined;
}

Matrix6d covariance_of(const SetupResult& session) {
  return session.uncertainty ? session.uncertainty->covariance : Matrix6d::Zero();
}

// Of a move: what the imagers put off at both of its ends is not in it.
Matrix6d covariance_in_moves(const SetupResult& session) {
  return covariance_of(session) - (session.by_imagers ? session.by_imagers->covariance : Matrix6d::Zero());
}

// What a small motion before `motion` is after it: motion * small = small' * motion.
Matrix6d carried_by(const Eigen::Isometry3d& motion) {
  Matrix6d carried = Matrix6d::Zero();
  carried.topLeftCorner<3, 3>() = carried.bottomRightCorner<3, 3>() = motion.linear();
  carried.topRightCorner<3, 3>() = cross_matrix(motion.translation()) * motion.linear();
  return carried;
}

// Where a session's phantom was found, and where it is known to have lain.
struct Placed {
  std::string name, condition;  // "HFS, kV"
  Eigen::Isometry3d found, known;
  std::array<bool, 6> are_determined{};
  Matrix6d covariance;  // of `found`
};

// A position or a move as it was found, and as it is known.
struct Compared {
  Eigen::Isometry3d found, known;
  std::array<bool, 6> are_determined{};
  Matrix6d covariance;  // of `found`

  // What `found` puts beside `known`: translation at the isocenter in mm, rotation vector in rad.
  Vector6d error() const {
    const Eigen::Isometry3d error = found * known.inverse();
    return (Vector6d() << error.translation(), rotation_vector(error.linear())).finished();
  }
};

Compared compared(const Placed& session) {
  return {session.found, session.known, session.are_determined, session.covariance};
}

Compared compared(const Placed& before, const Placed& now) {
  constexpr double kNothing = 0.01;  // of an undetermined axis that a turn brings into another
  Compared move{now.found * before.found.inverse(), now.known * before.known.inverse(), now.are_determined, {}};
  const Matrix6d carried = carried_by(move.found);
  move.covariance = now.covariance + carried * before.covariance * carried.transpose();
  for (std::size_t axis = 0; axis < 6; ++axis)
    for (std::size_t from = is_rotation(axis) ? 3 : 0; from < (is_rotation(axis) ? 6 : 3); ++from)
      if (!before.are_determined[from] &&
          std::abs(carried(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(from))) > kNothing)
        move.are_determined[axis] = false;
  return move;
}

Localized localized(const std::string& session, const Compared& compared, const Vector6d& error) {
  Localized one{.session = session,
                .known = components_of(compared.known),
                .found = components_of(compared.found),
                .error = {},
                .sigma = {}};
  for (std::size_t axis = 0; axis < 6; ++axis) {
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

std::string condition_of(const SetupResult& session) {
  std::set<std::string> beams;
  for (const SetupResult::View& view : session.views) beams.insert(view.is_megavoltage ? "MV" : "kV");
  return fmt::format("{}, {}", session.patient_position, fmt::join(beams, " and "));
}

// `poses`: unused with read-outs.
std::vector<Placed> placed(const std::vector<NamedResult>& sessions, Known known, const KnownPoses& poses) {
  std::vector<Placed> all;
  all.reserve(sessions.size());
  const auto& [first_name, first] = sessions.front();
  for (const auto& [name, result] : sessions) {
    Placed one{.name = name,
               .condition = condition_of(result),
               .found = result.setup_error,
               .known = known == Known::kReadOuts ? moved_by_table(first_name, first, name, result)
                                                  : poses.by_session.at(name),
               .are_determined = determined_axes(result),
               .covariance = covariance_of(result)};
    if (known != Known::kReadOuts && !poses.have_angles) std::fill_n(one.are_determined.begin() + 3, 3, false);
    if (known != Known::kPositions) {
      one.found = found_pose(result);
      one.covariance = covariance_in_moves(result);
    }
    all.push_back(std::move(one));
  }
  return all;
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
        if (!one.error[axis] || std::abs(one.known[axis]) < least || polarity[axis] == Outcome::kFailed) continue;
        // Half a turn is known as 180 or -180 degrees, and found beyond either.
        double off = one.found[axis] - one.known[axis];
        if (is_rotation(axis)) off = std::remainder(off, kTurnDeg);
        const double found_by_known = 1.0 + off / one.known[axis];
        polarity[axis] = found_by_known < 0.5 || found_by_known > 1.5 ? Outcome::kFailed : Outcome::kPassed;
      }
    }
  return polarities;
}

// Every session against the mean of all before it. These differences are independent where the sessions' uncertainties
// are equal (Helmert's contrasts); moves that share the first session are not.
std::vector<Localized> independent_errors(const std::vector<Placed>& sessions) {
  std::vector<Localized> independent;
  for (std::size_t now = 1; now < sessions.size(); ++now) {
    const auto before = static_cast<double>(now);
    Compared mean = compared(sessions[now]);
    Vector6d error = Vector6d::Zero();
    for (std::size_t n = 0; n < now; ++n) {
      const Compared move = compared(sessions[n], sessions[now]);
      error += move.error() / before;
      mean.covariance += (move.covariance - sessions[now].covariance) / (before * before);
      for (std::size_t axis = 0; axis < 6; ++axis)
        mean.are_determined[axis] = mean.are_determined[axis] && move.are_determined[axis];
    }
    independent.push_back(localized(sessions[now].name, mean, error));
  }
  return independent;
}

AxisOfLocalization axis_of(const Localization& localization, std::size_t axis,
                           const std::optional<LocalizationLimits>& limits) {
  AxisOfLocalization result;
  std::vector<double> errors;
  // Moves begin at 0.
  if (localization.known == Known::kPositions)
    result.least_known = result.most_known = localization.all.front().known[axis];
  for (const Localized& one : localization.all) {
    result.least_known = std::min(result.least_known, one.known[axis]);
    result.most_known = std::max(result.most_known, one.known[axis]);
    if (one.error[axis]) errors.push_back(*one.error[axis]);
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

void calibrate(Localization& localization, const std::vector<Localized>& errors) {
  constexpr double kOneSigma = 0.6827, kTwoSigma = 0.9545;
  std::size_t total = 0, within_one = 0, within_two = 0;
  for (const Localized& one : errors)
    for (std::size_t axis = 0; axis < 6; ++axis) {
      if (!one.error[axis] || !one.sigma[axis]) continue;
      ++total;
      within_one += std::abs(*one.error[axis]) <= *one.sigma[axis] ? 1U : 0U;
      within_two += std::abs(*one.error[axis]) <= 2.0 * *one.sigma[axis] ? 1U : 0U;
    }
  if (total == 0) return;
  localization.within_one_sigma = share_of(within_one, total);
  localization.within_two_sigma = share_of(within_two, total);
  const bool holds =
      localization.within_one_sigma->high >= kOneSigma && localization.within_two_sigma->high >= kTwoSigma;
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
  calibrate(localization, known == Known::kPositions ? localization.all : independent_errors(all));
  return localization;
}

}  // namespace isoshift
