#pragma once
// What a search varies: the setup error about the isocenter in IEC 61217 fixed, as translation in mm and rotation
// vector in mm on a sphere, so that all parameters move the anatomy alike. Three parameters are a translation only.

#include <Eigen/Geometry>
#include <span>
#include <vector>

namespace isoshift {

// The sphere's radius.
inline constexpr double kLeverMm = 100.0;

Eigen::Isometry3d setup_error_from_parameters(std::span<const double> parameters);
std::vector<double> parameters_from_setup_error(const Eigen::Isometry3d& setup_error);  // all six

// How parameters move the patient: a 6 x n matrix from small changes of n parameters to the motion on top of the setup
// error, in the room and about the isocenter, in the units of MotionDerivatives (drr/renderer.h): mm and rad. Rotations
// by the left Jacobian of SO(3) (Sola, Deray, Atchuthan, arXiv 1812.01537, eq. 145).
Eigen::Matrix<double, 6, Eigen::Dynamic> motions_per_parameter(std::span<const double> parameters);

// How far two setup errors lie apart: translation at the isocenter, and rotation.
struct PoseDistance {
  double translation_mm = 0.0;
  double angle_rad = 0.0;
};
PoseDistance distance_between(std::span<const double> parameters, std::span<const double> other);

}  // namespace isoshift
