#pragma once
// A side of the irradiated field, measured: where half the beam arrives along a line, block by block.

#include <vector>

#include "registration/preprocess/field_edges.h"

namespace isoshift {

// Where a block of rows shows the side.
struct Sighting {
  double row = 0.0, at = 0.0;  // pixels of the upright image
  double sigma_mm = 0.0;
};

// A left or right side (`sign` 1 or -1) near x = `near`, looked for in blocks of the rows [first, end), with a penumbra
// of this sigma.
struct SideSightings {
  std::vector<Sighting> seen;
  int blocks = 0;       // that were looked at
  double misfit = 0.0;  // what the model leaves of them: the sum of logarithms, so that clean blocks tell the penumbra
};
SideSightings sightings_of_side(const UprightXray& xray, int near, int sign, int first, int end, double penumbra_mm);

// The sigmas to choose from. All sides of a field have the same.
inline constexpr std::array kPenumbraSigmasMm = {0.3, 0.6, 1.0, 1.5, 2.1};

// x = at + slope * (y - middle) in pixels of the upright image.
struct SideLine {
  double at = 0.0, slope = 0.0, middle = 0.0;
  double sigma_mm = 0.0;    // of its place
  double scatter_mm = 0.0;  // of the sightings about the line: a collimator is straight
  double slope_sigma = 1e3;

  double x(double y) const { return at + slope * (y - middle); }
};

// The line through sightings (not none) whose slope is expected to be `slope`, give or take `slope_sigma`. What lies
// far off the others hardly counts.
SideLine line_through(const std::vector<Sighting>& seen, double pixel_mm, double slope, double slope_sigma);

// How bright it is again beyond a side, as the median over its rows: the logarithm of the brightest intensity 4 to 40
// mm beyond the side by that just inside. A rod or a couch is about as bright on both sides.
double brightness_beyond(const UprightXray& xray, int at, int sign, int first, int end);

}  // namespace isoshift
