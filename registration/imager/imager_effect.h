#pragma once
// How far errors of imagers put a registration off.

#include <Eigen/Core>
#include <span>

#include "geometry/imager_error.h"
#include "geometry/seen_motions.h"
#include "registration/search.h"
#include "setup/registration.h"

namespace isoshift {

// How an imager's errors move what its view shows of points within 50 mm of the isocenter, and how motions of the
// patient do: two rows per point, pixels per mm or rad. Motions are translations (mm) and then rotation vectors (rad)
// about the isocenter.
struct SeenBy {
  SeenMotions motions;
  Eigen::Matrix<double, Eigen::Dynamic, kImagerParameters> errors;
};
SeenBy seen_by(const ImagerModel& model);

struct ImagerInView {
  ImagerModel model;
  double pixels_per_mm = 1.0;  // at the isocenter
  KnownImager imager;
};

// The uncertainty of a pose that matches these points in all views, by what is left of each imager's errors. These act
// alike in all X-rays of an imager. Precondition: there is a view.
Uncertainty uncertainty_by_imagers(std::span<const ImagerInView> views, Dof dof);

}  // namespace isoshift
