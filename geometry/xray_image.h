#pragma once
// An X-ray image as registration sees it: a camera and pixel values of known meaning.

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "geometry/image.h"
#include "geometry/xray_view.h"

namespace isoshift {

// Where jaws and leaves leave the treatment beam open, as a file says it: a polygon with sides along the collimator's
// axes; jaws alone make a rectangle.
struct DeclaredAperture {
  std::vector<Eigen::Vector2d> corners_px;  // on the image, one after the other; may lie beyond its rim
  bool is_of_exposure = true;               // false: the X-ray need not have been taken through it (kV, a plan's beam)
};

struct XrayImage {
  enum class Meaning {
    kIntensity,     // proportional to the X-ray intensity at the receptor; 0 is no radiation
    kLineIntegral,  // grows linearly with the attenuation along the ray; scale and offset unknown
  };

  std::string label;
  XrayView view;
  Image<float> values;
  std::optional<Image<std::uint8_t>> padding;  // 1 where there is no pixel; its value is as if blocked
  Meaning meaning = Meaning::kIntensity;
  double collimator_angle_rad = 0.0;  // how the field's edges are turned in the image, counter-clockwise as displayed
  std::optional<DeclaredAperture> declared_aperture;
};

}  // namespace isoshift
