#include "workflow/commission/placed_sessions.h"

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

std::string condition_of(const SetupResult& session) {
  std::set<std::string> beams;
  for (const SetupResult::View& view : session.views) beams.insert(view.is_megavoltage ? "MV" : "kV");
  return fmt::format("{}, {}", session.patient_position, fmt::join(beams, " and "));
}

}  // namespace

std::vector<Placed> placed(const std::vector<NamedResult>& sessions, Known known, const KnownPoses& poses) {
  std::vector<Placed> all;
  all.reserve(sessions.size());
  const auto& [first_name, first] = sessions.front();
  for (const auto& [name, result] : sessions) {
    Placed one{.name = name,
               .condition = condition_of(result),
               .result = &result,
               .found = known == Known::kPositions ? result.setup_error : found_pose(result),
               .known = known == Known::kReadOuts ? moved_by_table(first_name, first, name, result)
                                                  : poses.by_session.at(name),
               .are_angles_known = known == Known::kReadOuts || poses.have_angles,
               .are_determined = determined_axes(result)};
    if (!one.are_angles_known) std::fill_n(one.are_determined.begin() + 3, 3, false);
    if (result.by_imagers) one.by_imagers = result.by_imagers->covariance;
    if (result.uncertainty) one.by_session = result.uncertainty->covariance - one.by_imagers;
    all.push_back(std::move(one));
  }
  return all;
}

bool have_same_views(const Placed& one, const Placed& other) {
  constexpr double kSameDeg = 1.0, kTurnDeg = 360.0;
  const auto is_in_other = [&](const SetupResult::View& view) {
    return std::ranges::any_of(other.result->views, [&](const SetupResult::View& candidate) {
      return view.is_megavoltage == candidate.is_megavoltage && view.gantry_deg && candidate.gantry_deg &&
             std::abs(std::remainder(*view.gantry_deg - *candidate.gantry_deg, kTurnDeg)) < kSameDeg;
    });
  };
  return one.result->views.size() == other.result->views.size() && std::ranges::all_of(one.result->views, is_in_other);
}

Matrix6d carried_by(const Eigen::Isometry3d& motion) {
  Matrix6d carried = Matrix6d::Zero();
  carried.topLeftCorner<3, 3>() = carried.bottomRightCorner<3, 3>() = motion.linear();
  carried.topRightCorner<3, 3>() = cross_matrix(motion.translation()) * motion.linear();
  return carried;
}

void CarriedErrors::add(const Placed& session, const Matrix6d& carried) {
  by_sessions_ += carried * session.by_session * carried.transpose();
  const auto alike = std::ranges::find_if(
      by_imagers_, [&](const Imagers& imagers) { return have_same_views(*imagers.first, session); });
  if (alike == by_imagers_.end())
    by_imagers_.push_back({.first = &session, .carried = carried});
  else
    alike->carried += carried;
}

Matrix6d CarriedErrors::covariance() const {
  Matrix6d covariance = by_sessions_;
  for (const Imagers& imagers : by_imagers_)
    covariance += imagers.carried * imagers.first->by_imagers * imagers.carried.transpose();
  return covariance;
}

Vector6d Compared::error() const {
  const Eigen::Isometry3d error = found * known.inverse();
  return (Vector6d() << error.translation(), rotation_vector(error.linear())).finished();
}

Compared compared(const Placed& session) {
  CarriedErrors errors;
  errors.add(session, Matrix6d::Identity());
  return {session.found, session.known, session.are_angles_known, session.are_determined, errors.covariance()};
}

Compared compared(const Placed& before, const Placed& now) {
  constexpr double kNothing = 0.01;  // of an undetermined axis that a turn brings into another
  Compared move{.found = now.found * before.found.inverse(),
                .known = now.known * before.known.inverse(),
                .are_angles_known = now.are_angles_known,
                .are_determined = now.are_determined,
                .covariance = {}};
  const Matrix6d carried = carried_by(move.found);
  CarriedErrors errors;
  errors.add(now, Matrix6d::Identity());
  errors.add(before, -carried);
  move.covariance = errors.covariance();
  for (std::size_t axis = 0; axis < 6; ++axis)
    for (std::size_t from = is_rotation(axis) ? 3 : 0; from < (is_rotation(axis) ? 6 : 3); ++from)
      if (!before.are_determined[from] &&
          std::abs(carried(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(from))) > kNothing)
        move.are_determined[axis] = false;
  return move;
}

}  // namespace isoshift
