#pragma once
// How an imager on a gantry may differ from what its X-rays' files say, and where it then shows a point.
//
// Axes are those of the gantry (IEC 61217): x to the right and y toward the gantry with the source at the top, z toward
// the source. The receptor is turned about the place where the central ray meets it, R = Rz Rx Ry, and then shifted.
// Sag is the part of a shift that follows the gantry angle: of x, and of y, with its cosine and its sine.

#include <Eigen/Geometry>
#include <array>
#include <string_view>

#include "geometry/xray_view.h"

namespace isoshift {

// The errors, mm and rad, in this order.
enum class ImagerParameter {
  kShiftX,
  kShiftXCos,
  kShiftXSin,
  kShiftY,
  kShiftYCos,
  kShiftYSin,
  kDistance,
  kRoll,
  kTiltX,
  kTiltY
};
inline constexpr std::size_t kImagerParameters = 10;
using ImagerErrors = std::array<double, kImagerParameters>;

struct ImagerParameterInfo {
  std::string_view name;  // "shift x"
  std::string_view key;   // "shift_x_mm"; angles end with _deg
  bool is_angle = false;
  double expected = 0.0;              // one standard deviation before anything is measured, mm or rad
  double largest_sigma = 0.0;         // beyond it the parameter counts as undetermined
  std::string_view why_undetermined;  // "it ...": what does alike, or where it is seen
};
const std::array<ImagerParameterInfo, kImagerParameters>& imager_parameters();

// What is known of an imager's errors: the most probable value of each, and one standard deviation. What is not known
// has the value 0.
struct KnownImager {
  std::size_t number = 0;  // X-rays with one number are of one imager
  ImagerErrors values{}, sigmas{};
  bool is_corrected = false;  // the views lie where the receptor is, and not where their files say

  // One standard deviation of each error that the views still have.
  ImagerErrors left() const;
};

class ImagerModel {
 public:
  // A view of a gantry at that angle, whose receptor lies `sid_mm` from the source (a view's rays may end elsewhere).
  // Precondition: it is no line scan.
  ImagerModel(const XrayView& view, double gantry_rad, double sid_mm);

  // The projection matrix, up to scale.
  Eigen::Matrix<double, 3, 4> pixel_from_room(const ImagerErrors& errors) const;

  // (column, row) of a point of the room. Precondition: it lies between source and receptor.
  Eigen::Vector2d pixel_of(const Eigen::Vector3d& point_room_mm, const ImagerErrors& errors) const;

  double pixel_mm() const { return pixel_mm_; }  // on the receptor

 private:
  Eigen::Vector3d source_mm_, center_mm_;  // in the room: of the source, and where the central ray meets the receptor
  Eigen::Matrix3d gantry_from_room_;
  double gantry_rad_ = 0.0;
  Eigen::Vector2d first_pixel_mm_;  // on the receptor, from its center along the gantry's x and y
  Eigen::Matrix2d pixel_from_receptor_mm_;
  double pixel_mm_ = 0.0;
};

// The view of an imager with these errors, whose files give `view`.
XrayView with_errors(const XrayView& view, double gantry_rad, double sid_mm, const ImagerErrors& errors);

}  // namespace isoshift
