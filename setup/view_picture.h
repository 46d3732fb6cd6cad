#pragma once
// One view as a person compares it: X-ray and DRRs in one gray scale, and what is marked in them.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/image.h"

namespace isoshift {

inline constexpr double kMotionMagnified = 5.0;

using Polygon = std::vector<Eigen::Vector2d>;  // closed, pixels of the picture

struct ViewPicture {
  struct Outline {
    std::string name;
    std::vector<Polygon> planned, found;  // with the patient as planned, and as found
  };

  Image<std::uint8_t> xray, drr_planned, drr_found;  // of the same size; dense is bright, dimmed outside the field
  std::vector<Polygon> field;                        // edges of what was compared
  std::vector<Outline> structures;
  std::vector<Polygon> moved;  // arrows: how bones lie off once the target is right, kMotionMagnified times as long
  Eigen::Vector2d isocenter_px = Eigen::Vector2d::Zero();
  double pixels_per_mm = 0.0;             // at the isocenter
  std::array<std::string, 4> directions;  // of the patient, at the left, right, upper and lower edge: "L", "HA", ...
};

}  // namespace isoshift
