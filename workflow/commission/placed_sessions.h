#pragma once
// Where the phantom of every session was found and where it is known to have lain, and what the uncertainties of
// positions, moves and means of them are.

#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

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
  Matrix6d by_imagers = Matrix6d::Zero();  // covariance of `found`: what is alike in all sessions of the same views
  Matrix6d by_session = Matrix6d::Zero();  // and what is this session's own
};

// `poses`: unused with read-outs. The placed point to the sessions.
std::vector<Placed> placed(const std::vector<NamedResult>& sessions, Known known, const KnownPoses& poses);

// Whether what the imagers put off is alike in both: X-rays by the same beams from the same sides.
bool have_same_views(const Placed& one, const Placed& other);

// What a small motion before `motion` is after it: motion * small = small' * motion.
Matrix6d carried_by(const Eigen::Isometry3d& motion);

// The covariance of a sum of sessions' errors, each of which a matrix carries to where it counts.
class CarriedErrors {
 public:
  void add(const Placed& session, const Matrix6d& carried);
  Matrix6d covariance() const;

 private:
  struct Imagers {
    const Placed* first;  // session with these views
    Matrix6d carried;     // of all of them together
  };
  Matrix6d by_sessions_ = Matrix6d::Zero();
  std::vector<Imagers> by_imagers_;
};

// A position or a move as it was found, and as it is known.
struct Compared {
  Eigen::Isometry3d found, known;
  bool are_angles_known = true;
  std::array<bool, 6> are_determined{};
  Matrix6d covariance;  // of `found`

  // What `found` puts beside `known`: translation at the isocenter in mm, rotation vector in rad.
  Vector6d error() const;
};

// The position of a session.
Compared compared(const Placed& session);

// The move between two. Axes that `before` does not determine are not determined where the move carries them.
Compared compared(const Placed& before, const Placed& now);

}  // namespace isoshift
