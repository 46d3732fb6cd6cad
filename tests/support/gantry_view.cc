#include "tests/support/gantry_view.h"

#include "geometry/rotation.h"

namespace isoshift {

XrayView view_from_gantry(double gantry_deg) {
  constexpr double kSadMm = 1000.0;
  const double corner_mm = 0.5 * (kGantryViewPixels - 1) * kGantryViewPixelMm;
  return make_xray_view({.sad_mm = kSadMm,
                         .gantry_angle_rad = rad_from_deg(gantry_deg),
                         .receptor_translation_mm = {0, 0, kSadMm - kGantryViewSidMm},
                         .column_spacing_mm = kGantryViewPixelMm,
                         .row_spacing_mm = kGantryViewPixelMm,
                         .position_mm = {-corner_mm, corner_mm},
                         .columns = kGantryViewPixels,
                         .rows = kGantryViewPixels},
                        Beam::kKilovoltage);
}

}  // namespace isoshift
