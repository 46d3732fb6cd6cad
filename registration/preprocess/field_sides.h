#pragma once
// The sides of the irradiated field, measured: where half the beam arrives along them.

#include <array>
#include <vector>

#include "registration/preprocess/field_edges.h"

namespace isoshift {

// x = at + slope * (y - middle) in pixels of the upright image.
struct SideLine {
  double at = 0.0, slope = 0.0, middle = 0.0;
  double sigma_mm = 0.0;    // of its place
  double scatter_mm = 0.0;  // of the places that its blocks would have by themselves: a collimator is straight
  double seen = 0.0;        // share of its blocks that show an edge
  double misfit = 0.0;      // what the model of an edge leaves unexplained: share of the intensity
  double wide_mm = 0.0;     // how far off another place explains the side nearly as well

  double x(double y) const { return at + slope * (y - middle); }
};

// A side to measure: a left or right side (`sign` 1 or -1) of `xray` near x = `near`, along the rows [first, end).
struct SideToMeasure {
  const UprightXray* xray = nullptr;  // not null
  int near = 0, sign = 1, first = 0, end = 0;
  // +1: a positive turn of the field makes its slope positive.
  int slope_sign = 1;
  // Beyond the side the image darkens all the way to another edge, which tells nothing of this one.
  bool has_slope = false;
};

// The lines of all sides of a field. They are measured together, since the sides of a field share their penumbra and
// their turn. `turn_sigma`: of the field against the collimator angle, radians.
std::vector<SideLine> measured_lines(const std::vector<SideToMeasure>& sides, double turn_sigma);

// How bright it is again beyond a side, as the median over its rows: the logarithm of the brightest intensity 4 to 40
// mm beyond the side by that just inside. A rod or a couch is about as bright on both sides.
double brightness_beyond(const UprightXray& xray, int at, int sign, int first, int end);

}  // namespace isoshift
