#pragma once
// A start from points of the anatomy that a person finds both in the X-rays and in the DRRs beside them.

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <vector>

#include "geometry/xray_view.h"

namespace isoshift {

// One point of the anatomy: its pixel (column, row; centers at integers) by view, where the person has marked it.
struct Landmark {
  std::vector<std::optional<Eigen::Vector2d>> in_xrays, in_drrs;
};

struct LandmarkFit {
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  double left_mm = 0.0;   // root mean square distance of the points after the fit; 0 for one point
  double apart_mm = 0.0;  // the largest distance of a point from a ray on which it was marked
};

// The setup error (room, IEC 61217 fixed, about the isocenter) for which the points in the DRRs come to lie where they
// are in the X-rays. Every point is where the rays to its marks come nearest to each other. `current`: the setup error
// of the DRRs. One point gives a translation, two the smallest rotation that also turns their line, three and more the
// rigid motion of least squares (Umeyama, IEEE PAMI 13 (1991) 376). Throws Error, naming the landmark by its number
// from 1, for one that is not marked in two X-rays and two DRRs, or only in views from nearly one direction, and if
// there is none, two are at one place, or three and more lie on a line.
LandmarkFit fit_landmarks(std::span<const XrayView> views, std::span<const Landmark> landmarks,
                          const Eigen::Isometry3d& current);

}  // namespace isoshift
