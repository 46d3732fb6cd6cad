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

bool is_same_angle(double one_deg, double other_deg) {
  constexpr double kSameDeg = 1.0, kTurnDeg = 360.0;
  return std::abs(std::remainder(one_deg - other_deg, kTurnDeg)) < kSameDeg;
}

bool is_same_view(const SetupResult::View& one, const SetupResult::View& other) {
  if (one.is_megavoltage != other.is_megavoltage) return false;
  if (one.gantry_deg && other.gantry_deg) return is_same_angle(*one.gantry_deg, *other.gantry_deg);
  return !one.gantry_deg && !other.gantry_deg && one.pixel_from_room && other.pixel_from_room &&
         one.pixel_from_room->isApprox(*other.pixel_from_room);
}

std::string condition_of(const SetupResult& session) {
  std::set<std::string> beams;
  for (const SetupResult::View& view : session.views) beams.insert(view.is_megavoltage ? "MV" : "kV");
  return fmt::format("{}, {}", session.patient_position, fmt::join(beams, " and "));
}

// An unknown rotation must not turn what is known.
Vector6d error_of(const Eigen::Isometry3d& found, const Eigen::Isometry3d& known, bool are_angles_known) {
  const Eigen::Isometry3d error = found * known.inverse();
  Vector6d components;
  components << error.translation(), rotation_vector(error.linear());
  if (!are_angles_known) components.head<3>() = found.translation() - known.translation();
  return components;
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
    if (result.by_imagers) one.imager_covariance = result.by_imagers->covariance;
    if (result.uncertainty) one.own_covariance = result.uncertainty->covariance - one.imager_covariance;
    all.push_back(std::move(one));
  }
  return all;
}

bool have_same_views(const Placed& one, const Placed& other) {
  const std::vector<SetupResult::View>&some = one.result->views, &others = other.result->views;
  const auto are_in = [](const std::vector<SetupResult::View>& views, const std::vector<SetupResult::View>& all) {
    return std::ranges::all_of(views, [&](const SetupResult::View& view) {
      return std::ranges::any_of(all,
                                 [&](const SetupResult::View& candidate) { return is_same_view(view, candidate); });
    });
  };
  return some.size() == others.size() && are_in(some, others) && are_in(others, some);
}

bool have_same_couch_angle(const Placed& one, const Placed& other) {
  return is_same_angle(deg_from_rad(one.result->table.yaw_rad()), deg_from_rad(other.result->table.yaw_rad()));
}

Matrix6d carried_by(const Eigen::Isometry3d& motion) {
  Matrix6d carried = Matrix6d::Zero();
  carried.topLeftCorner<3, 3>() = carried.bottomRightCorner<3, 3>() = motion.linear();
  carried.topRightCorner<3, 3>() = cross_matrix(motion.translation()) * motion.linear();
  return carried;
}

void CarriedErrors::add(const Placed& session, const Matrix6d& carried) {
  if (!session.own_covariance)
    own_.reset();
  else if (own_)
    *own_ += carried * *session.own_covariance * carried.transpose();
  const auto alike =
      std::ranges::find_if(imagers_, [&](const Imagers& imagers) { return have_same_views(*imagers.first, session); });
  if (alike == imagers_.end())
    imagers_.push_back({.first = &session, .carried = carried});
  else
    alike->carried += carried;
}

std::optional<Matrix6d> CarriedErrors::covariance() const {
  std::optional<Matrix6d> covariance = own_;
  if (!covariance) return std::nullopt;
  for (const Imagers& imagers : imagers_)
    *covariance += imagers.carried * imagers.first->imager_covariance * imagers.carried.transpose();
  return covariance;
}

Matrix6d at_known_point(const Placed& session) {
  Matrix6d carried = Matrix6d::Identity();
  if (!session.are_angles_known) carried.topRightCorner<3, 3>() = -cross_matrix(session.known.translation());
  return carried;
}

Compared compared(const Placed& session) {
  CarriedErrors errors;
  errors.add(session, at_known_point(session));
  return {.found = session.found,
          .known = session.known,
          .are_angles_known = session.are_angles_known,
          .are_determined = session.are_determined,
          .error = error_of(session.found, session.known, session.are_angles_known),
          .covariance = errors.covariance()};
}

Compared compared(const Placed& before, const Placed& now) {
  constexpr double kNothing = 0.01;  // of an undetermined axis that a turn brings into another
  const Eigen::Isometry3d motion = now.found * before.found.inverse();
  Eigen::Translation3d to_point(Eigen::Vector3d::Zero());
  if (!now.are_angles_known) to_point.vector() = before.known.translation();
  Compared move{.found = to_point.inverse() * motion * to_point,
                .known = now.known * before.known.inverse(),
                .are_angles_known = now.are_angles_known,
                .are_determined = now.are_determined,
                .error = {},
                .covariance = {}};
  move.error = error_of(move.found, move.known, move.are_angles_known);
  const Matrix6d carried = carried_by(motion);
  CarriedErrors errors;
  errors.add(now, at_known_point(now));
  errors.add(before, -at_known_point(now) * carried);
  move.covariance = errors.covariance();
  for (std::size_t axis = 0; axis < 6; ++axis)
    for (std::size_t from = is_rotation(axis) ? 3 : 0; from < (is_rotation(axis) ? 6 : 3); ++from)
      if (!before.are_determined[from] &&
          std::abs(carried(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(from))) > kNothing)
        move.are_determined[axis] = false;
  return move;
}

Localized localized(const std::string& session, const Compared& compared) {
  Localized one{.session = session, .known = {}, .found = components_of(compared.found), .error = {}, .sigma = {}};
  const ErrorComponents known = components_of(compared.known);
  for (std::size_t axis = 0; axis < 6; ++axis) {
    if (compared.are_angles_known || !is_rotation(axis)) one.known[axis] = known[axis];
    if (!compared.are_determined[axis]) continue;
    const auto n = static_cast<Eigen::Index>(axis);
    const double unit = is_rotation(axis) ? deg_from_rad(1.0) : 1.0;
    one.error[axis] = unit * compared.error[n];
    if (compared.covariance && (*compared.covariance)(n, n) > 0.0)
      one.sigma[axis] = unit * std::sqrt((*compared.covariance)(n, n));
  }
  return one;
}

}  // namespace isoshift
