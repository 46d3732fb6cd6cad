#pragma once
// How far one setup error lies from another, at target points (van de Kraats et al., IEEE TMI 24, 2005). A setup error
// T puts anatomy planned at x (room, mm from the isocenter) at T x.

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "geometry/xray_view.h"

namespace isoshift {

// The 27 points {-50, 0, 50}^3 mm about the isocenter.
std::vector<Eigen::Vector3d> standard_targets_mm();

// mTRE, mean target registration error: the mean distance between where two setup errors put the targets, mm.
double mean_target_registration_error_mm(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
                                         std::span<const Eigen::Vector3d> targets_mm);

// mPD, mean projection distance: the mean distance on the receptor between the targets' projections, mm. Infinite where
// a target has none.
double mean_projection_distance_mm(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
                                   std::span<const Eigen::Vector3d> targets_mm, const XrayView& view);

// mRPD, mean reprojection distance: the mean distance between a target at its true place and the ray through the place
// where it was found, mm. This is the part of an error that one view can see.
double mean_reprojection_distance_mm(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
                                     std::span<const Eigen::Vector3d> targets_mm, const XrayView& view);

// How much of an error comes from rotation: r / (r + t), where r is the mean distance over which the rotation about the
// isocenter alone moves the targets, and t the length of the translation. 0 for no error.
double rotation_share(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
                      std::span<const Eigen::Vector3d> targets_mm);

}  // namespace isoshift
