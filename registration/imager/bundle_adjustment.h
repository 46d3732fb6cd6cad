#pragma once
// An imager's geometry from X-rays of balls: bundle adjustment. The errors of the imager, the poses of the phantom and
// the centers of its balls (which a CT of 1 mm voxels gives to about 0.1 mm) are those at which the balls of the CT are
// seen where the X-rays show them, by least squares with a robust loss (Triggs, McLauchlan, Hartley, Fitzgibbon,
// "Bundle adjustment, a modern synthesis", 2000).

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "geometry/imager_error.h"
#include "registration/imager/balls.h"
#include "registration/imager/imager_estimate.h"

namespace isoshift {

struct BallView {
  std::string label;
  ImagerModel model;
  std::size_t imager = 0;  // of those that are estimated
  DarkSpots spots;
  double radius_px = 0.0;  // of the balls
};

struct BallSession {
  std::string name;
  Eigen::Isometry3d planned_room_from_patient = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d known_setup_error = Eigen::Isometry3d::Identity();  // as BallPoses says
  std::vector<BallView> views;
};

// What is known of the phantom's poses.
enum class BallPoses {
  kFree,       // nothing
  kMoves,      // how it lay in every session, up to one motion that all share
  kPositions,  // where it lay
};

struct BundleAdjustment {
  std::vector<ImagerEstimate> imagers;
  std::vector<Eigen::Isometry3d> setup_errors;  // of the sessions
  // One standard deviation of each, and of each against the first: translation (mm) and rotation vector (rad); 0 of
  // what is known.
  std::vector<std::array<double, 6>> pose_sigmas, move_sigmas;
  std::size_t seen = 0, expected = 0;  // places of balls: used, and those that the views could show
  double rms_mm = 0.0;                 // of what remains, on the receptor, per axis
};

// `imagers`: their number. Balls that hide each other are not used, and those outside the irradiated field are not
// missed. Throws Error if too few balls are found where the views should show them.
BundleAdjustment adjusted(const std::vector<Ball>& balls, const std::vector<BallSession>& sessions, BallPoses poses,
                          std::size_t imagers);

}  // namespace isoshift
