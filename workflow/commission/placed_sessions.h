#pragma once
// Where the phantom of every session was found and where it is known to have lain, and what the uncertainties of
// positions, moves and means of them are.

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "setup/setup_errors.h"
#include "workflow/commission/known_poses.h"
#include "workflow/results_below.h"

namespace isoshift {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// Where a session's phantom was found, and where it is known to have lain.
struct Placed {
  std::string name, condition;  // "HFS, kV"
  const SetupResult* result = nullptr;
  Eigen::Isometry3d found, known;
  bool are_angles_known = true;  // otherwise nothing is turned in `known`, and no angle is determined
  std::array<bool, 6> are_determined{};
  // Of `found`: what may be wrong with the imagers, alike in all sessions of the same views, and what is this session's
  // own. No own: the result has no uncertainty.
  Matrix6d imager_covariance = Matrix6d::Zero();
  std::optional<Matrix6d> own_covariance;
};

// `poses`: unused with read-outs. The placed point to the sessions.
std::vector<Placed> placed(const std::vector<NamedResult>& sessions, Known known, const KnownPoses& poses);

// X-rays by the same beams from the same sides, to within a degree: what imagers put off is alike in both.
bool have_same_views(const Placed& one, const Placed& other);
bool have_same_couch_angle(const Placed& one, const Placed& other);

// What a small motion before `motion` is after it: motion * small = small' * motion.
Matrix6d carried_by(const Eigen::Isometry3d& motion);

// A sum of sessions' errors, each of which a matrix carries to where it counts.
class CarriedErrors {
 public:
  void add(const Placed& session, const Matrix6d& carried);
  std::optional<Matrix6d> covariance() const;  // nothing: one of the sessions has no uncertainty

 private:
  struct Imagers {
    const Placed* first;  // session with these views
    Matrix6d carried;     // of all of them together
  };
  std::optional<Matrix6d> own_ = Matrix6d::Zero();
  std::vector<Imagers> imagers_;
};

// A session's errors where they count: at the isocenter, but without angles where the point lies that was planned
// there, of which alone it is known where it lies.
Matrix6d at_known_point(const Placed& session);

// A position or a move as it was found, and as it is known. Without angles, the translations of a move are those of the
// point that was planned at the isocenter.
struct Compared {
  Eigen::Isometry3d found, known;
  bool are_angles_known = true;
  std::array<bool, 6> are_determined{};
  // What `found` puts beside `known`: translation at the isocenter in mm, rotation vector in rad. Without angles: found
  // less known.
  Vector6d error;
  std::optional<Matrix6d> covariance;  // of the error
};

// The position of a session.
Compared compared(const Placed& session);

// The move between two. Axes that `before` does not determine are not determined where the move carries them.
Compared compared(const Placed& before, const Placed& now);

// The same per axis, in mm and degrees. Components are along and about the axes of IEC 61217 fixed, of the motion from
// the planned pose (positions) or from another session's (moves).
struct Localized {
  std::string session;
  std::array<std::optional<double>, 6> known;  // unset: an angle that the table of known poses does not name
  ErrorComponents found{};
  // Unset: the X-rays do not determine this axis, or the result has no uncertainty.
  std::array<std::optional<double>, 6> error, sigma;
};
Localized localized(const std::string& session, const Compared& compared);

}  // namespace isoshift
