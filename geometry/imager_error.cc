#include "geometry/imager_error.h"

#include <Eigen/LU>
#include <cmath>

#include "geometry/rotation.h"

namespace isoshift {
namespace {

double value(const ImagerErrors& errors, ImagerParameter parameter) {
  return errors[static_cast<std::size_t>(parameter)];
}

}  // namespace

const std::array<ImagerParameterInfo, kImagerParameters>& imager_parameters() {
  constexpr double kShiftMm = 5.0, kSagMm = 3.0, kDistanceMm = 15.0, kTurnRad = rad_from_deg(2.0);
  constexpr double kKnownMm = 0.3, kKnownDistanceMm = 3.0, kKnownRad = rad_from_deg(0.15);
  static constexpr std::array<ImagerParameterInfo, kImagerParameters> kAll = {{
      {"shift x", "shift_x_mm", false, kShiftMm, kKnownMm, "acts like a shift across the beam, unless views oppose"},
      {"shift x, cosine of the gantry angle", "shift_x_cos_mm", false, kSagMm, kKnownMm, "acts like a shift along x"},
      {"shift x, sine of the gantry angle", "shift_x_sin_mm", false, kSagMm, kKnownMm, "acts like a shift along z"},
      {"shift y", "shift_y_mm", false, kShiftMm, kKnownMm, "acts like a shift along y"},
      {"shift y, cosine of the gantry angle", "shift_y_cos_mm", false, kSagMm, kKnownMm, "acts like a turn about x"},
      {"shift y, sine of the gantry angle", "shift_y_sin_mm", false, kSagMm, kKnownMm, "acts like a turn about z"},
      {"distance", "distance_mm", false, kDistanceMm, kKnownDistanceMm, "is seen only far from the central ray"},
      {"roll (about the central ray)", "roll_deg", true, kTurnRad, kKnownRad, "is seen only far from the central ray"},
      {"tilt about x", "tilt_x_deg", true, kTurnRad, kKnownRad, "is seen only far from the central ray"},
      {"tilt about y", "tilt_y_deg", true, kTurnRad, kKnownRad, "is seen only far from the central ray"},
  }};
  return kAll;
}

ImagerErrors KnownImager::left() const {
  ImagerErrors left = sigmas;
  if (!is_corrected)
    for (std::size_t n = 0; n < left.size(); ++n) left[n] = std::hypot(values[n], sigmas[n]);
  return left;
}

ImagerModel::ImagerModel(const XrayView& view, double gantry_rad, double sid_mm)
    : source_mm_(view.source_room_mm), gantry_rad_(gantry_rad) {
  gantry_from_room_ = rotation_y(gantry_rad).transpose();
  // Where rays through the corner and its neighbors end, and, seen from the source, where they meet the receptor.
  const Eigen::Vector3d end = view.ray(0, 0).pixel_room_mm;
  Eigen::Vector3d column = view.ray(1, 0).pixel_room_mm - end, row = view.ray(0, 1).pixel_room_mm - end;
  const Eigen::Vector3d normal = column.cross(row);
  const Eigen::Vector3d along = -source_mm_;  // to the isocenter
  const double to_center = normal.dot(end - source_mm_) / normal.dot(along);
  const double to_receptor = sid_mm / (to_center * along.norm());
  column *= to_receptor;
  row *= to_receptor;
  const Eigen::Vector3d first = source_mm_ + to_receptor * (end - source_mm_);
  center_mm_ = source_mm_ + to_receptor * to_center * along;
  const auto on_receptor = [&](const Eigen::Vector3d& vector) -> Eigen::Vector2d {
    return (gantry_from_room_ * vector).head<2>();
  };
  first_pixel_mm_ = on_receptor(first - center_mm_);
  Eigen::Matrix2d receptor_from_pixel;
  receptor_from_pixel << on_receptor(column), on_receptor(row);
  pixel_from_receptor_mm_ = receptor_from_pixel.inverse();
  pixel_mm_ = std::sqrt(std::abs(receptor_from_pixel.determinant()));
}

Eigen::Matrix<double, 3, 4> ImagerModel::pixel_from_room(const ImagerErrors& errors) const {
  using enum ImagerParameter;
  const double cosine = std::cos(gantry_rad_), sine = std::sin(gantry_rad_);
  const Eigen::Vector3d shift(
      value(errors, kShiftX) + cosine * value(errors, kShiftXCos) + sine * value(errors, kShiftXSin),
      value(errors, kShiftY) + cosine * value(errors, kShiftYCos) + sine * value(errors, kShiftYSin),
      value(errors, kDistance));
  const Eigen::Matrix3d receptor_from_gantry =
      rotation_from_zxy({.z_rad = value(errors, kRoll), .x_rad = value(errors, kTiltX), .y_rad = value(errors, kTiltY)})
          .transpose();
  // In the receptor's own axes, whose plane is z = 0: the source, and the way from it to a point. The ray along that
  // way meets the plane at source - source.z / way.z * way.
  const Eigen::Vector3d source = receptor_from_gantry * (gantry_from_room_ * (source_mm_ - center_mm_) - shift);
  Eigen::Matrix<double, 3, 4> way;
  way.leftCols<3>() = receptor_from_gantry * gantry_from_room_;
  way.col(3) = -way.leftCols<3>() * source_mm_;
  Eigen::Matrix<double, 3, 4> matrix;
  matrix.topRows<2>() =
      pixel_from_receptor_mm_ * ((source.head<2>() - first_pixel_mm_) * way.row(2) - source.z() * way.topRows<2>());
  matrix.row(2) = way.row(2);
  return matrix;
}

Eigen::Vector2d ImagerModel::pixel_of(const Eigen::Vector3d& point_room_mm, const ImagerErrors& errors) const {
  return (pixel_from_room(errors) * point_room_mm.homogeneous()).hnormalized();
}

XrayView with_errors(const XrayView& view, double gantry_rad, double sid_mm, const ImagerErrors& errors) {
  XrayView other = view;
  other.pixel_from_room = ImagerModel(view, gantry_rad, sid_mm).pixel_from_room(errors);
  // Rays end where they ended.
  other.pixel_from_room *= view.pixel_from_room(2, 3) / other.pixel_from_room(2, 3);
  return other;
}

}  // namespace isoshift
