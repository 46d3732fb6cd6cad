#pragma once
// The view of an imager on a gantry, for tests of its geometry.

#include "geometry/xray_view.h"

namespace isoshift {

inline constexpr int kGantryViewPixels = 512;
inline constexpr double kGantryViewPixelMm = 0.8, kGantryViewSidMm = 1500.0;

// From 1000 mm, centered, with square pixels.
XrayView view_from_gantry(double gantry_deg);

}  // namespace isoshift
