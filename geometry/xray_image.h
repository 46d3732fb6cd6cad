#pragma once
// An X-ray image as registration sees it: a camera and pixel values of known meaning.

#include <string>

#include "geometry/image.h"
#include "geometry/xray_view.h"

namespace isoshift {

struct XrayImage {
  enum class Meaning {
    kIntensity,     // proportional to the X-ray intensity at the receptor; 0 is no radiation
    kLineIntegral,  // grows linearly with the attenuation along the ray; scale and offset unknown
  };

  std::string label;
  XrayView view;
  Image<float> values;
  Meaning meaning = Meaning::kIntensity;
  double collimator_angle_rad = 0.0;  // how the field's edges are turned in the image, counter-clockwise as displayed
};

}  // namespace isoshift
