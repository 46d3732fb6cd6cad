#pragma once
// X-rays of a body in a collimated field, written down at the isocenter plane without anything that finds fields: the
// truth for the tests of the irradiated field.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/xray_image.h"

namespace isoshift {

struct CollimatedXray {
  enum class Body { kSkull, kThorax, kLimb, kBall, kNone };  // kLimb: air on both sides

  Body body = Body::kSkull;
  int metal_rods = 0;      // straight ones, anywhere, at any angle
  bool has_couch = false;  // a plate parallel to the panel's columns, seen edge-on
  // The field at the isocenter, along the collimator's axes: x to the right, y up, as the image is displayed.
  Eigen::Vector2d lower_mm = Eigen::Vector2d(-60, -60), upper_mm = Eigen::Vector2d(60, 60);
  double collimator_deg = 0.0;  // counter-clockwise as displayed
  double penumbra_mm = 2.0;     // from 20 % to 80 %
  double leakage = 0.01;        // of what would arrive without collimator
  double scatter = 0.1;         // of the primary, blurred by 30 mm and more
  double photons = 20000.0;     // of an open pixel
  double gain_slope = 0.05;     // of the receptor, from its middle to its rim
  int pixels = 512;             // along an edge of a panel of 400 mm, at the isocenter 267 mm
  std::uint64_t seed = 1;       // of the body and the noise
  bool is_cone = false;         // the field is the circle in the middle of its rectangle, as wide as its shorter side
  double halo_share = 0.0;  // of the field's light that is blurred by 3.5 mm: rounded leaf ends, light spread in the
                            // receptor
  // Jaws behind the field, wherever they let the beam through.
  Eigen::Vector2d jaw_lower_mm = Eigen::Vector2d(-1000, -1000), jaw_upper_mm = Eigen::Vector2d(1000, 1000);
  Beam beam = Beam::kKilovoltage;  // named in the view; the body attenuates as for kilovolts
};

XrayImage xray_of(const CollimatedXray& scene);

// A field of 4 to 20 cm, wherever it lies, over bone, air or metal; leakage 0 to 2 %, scatter 0 to 20 %, penumbra 1 to
// 3 mm. One in four is turned, one in five open to the panel's rim on one side or more. No side lies within 6 mm of the
// rim.
CollimatedXray random_collimated_xray(std::uint64_t seed);

// The same body and receptor with an open field.
CollimatedXray opened(CollimatedXray scene);

// The distance from a side of the true field to the farthest point of the polygon's nearest side, at the isocenter: the
// largest of all sides. Sides beyond the rim count as the rim.
double field_error_mm(const CollimatedXray& scene, const XrayView& view,
                      const std::vector<Eigen::Vector2d>& corners_px);

}  // namespace isoshift
