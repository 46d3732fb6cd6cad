#pragma once
// How far the pose found may lie from the true one, from the images alone (docs/algorithms.md, "Uncertainty").
//
// Maximizing gradient correlation is least squares on gradients of unit norm: 2 (1 - GC) = |x - d(p)|^2. At the
// optimum, with J the derivatives of d by the pose and r = x - d, the covariance is the sandwich H^-1 M H^-1 of
// curvature H = sum rho J'J (rho the correlation) and scatter M = sum over tiles of s s', s = J'r of a tile (White
// 1980; Liang and Zeger 1986): residuals may have any size and be alike within a tile, as those of anatomy, noise and
// scatter are.

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "registration/objective.h"
#include "setup/registration.h"

namespace isoshift {

struct UncertaintyOptions {
  bool translation_only = false;        // rotations are taken as known and get 0
  double voxel_mm = 1.0;                // edge of the CT's voxels
  bool has_volume_of_interest = false;  // what overlaps it is in the X-rays only
};

// `objective` compares by gradient correlation. Nothing where the images do not determine the pose (a singular
// curvature).
std::optional<Uncertainty> estimated_uncertainty(Objective& objective, const Eigen::Isometry3d& room_from_patient,
                                                 const UncertaintyOptions& options);

// What the images tell of the parameters of a pose (pose_parameters.h: three translations in mm, and of six the
// rotation vector in mm), without the corrections of estimated_uncertainty(): in gradient correlation per mm^2, and
// squared.
struct PoseInformation {
  Eigen::MatrixXd curvature, scatter;

  // `spring` holds every parameter, in gradient correlation per mm^2: what the images do not see then has a finite
  // variance.
  Eigen::MatrixXd held_curvature(double spring) const;
  Eigen::MatrixXd covariance(double spring) const;
};
PoseInformation pose_information(Objective& objective, const Eigen::Isometry3d& room_from_patient,
                                 bool translation_only);

// If restarts end farther apart than four sigma, sigma becomes a quarter of their spread: the curvature was misleading.
// For example, a ball looks the same however it is turned, but the edges of its voxels in the DRR do not, so that the
// similarity has a curvature that says nothing about the pose.
Uncertainty widened_to_spread(const Uncertainty& uncertainty, double spread_mm, double spread_rad);

}  // namespace isoshift
