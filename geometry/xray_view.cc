#include "geometry/xray_view.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/error.h"
#include "geometry/rotation.h"

namespace isoshift {

std::optional<Eigen::Vector2d> XrayView::project(const Eigen::Vector3d& point_room_mm) const {
  const Eigen::Vector3d h = pixel_from_room * point_room_mm.homogeneous();
  if (h.z() <= 0.0) return std::nullopt;
  if (is_line_scan()) return Eigen::Vector2d(h.x() / h.z(), h.y());
  return Eigen::Vector2d(h.hnormalized());
}

Ray XrayView::ray(double column, double row) const {
  // By its scaling, the matrix maps a receptor point to (column, row, 1) exactly; of a line scan, in its own row.
  const Eigen::Vector3d pixel_from_source =
      pixel_from_room.leftCols<3>().inverse() * Eigen::Vector3d(column, is_line_scan() ? 0.0 : row, 1.0);
  const Eigen::Vector3d source = source_of_row_mm(row);
  return {.source_room_mm = source, .pixel_room_mm = source + pixel_from_source};
}

Eigen::Vector3d XrayView::source_for_mm(const Eigen::Vector3d& point_room_mm) const {
  return is_line_scan() ? source_of_row_mm(pixel_from_room.row(1) * point_room_mm.homogeneous()) : source_room_mm;
}

XrayView XrayView::downscaled(int factor) const {
  Eigen::Matrix3d block_from_pixel = Eigen::Matrix3d::Identity();
  block_from_pixel.diagonal().head<2>().setConstant(1.0 / factor);
  block_from_pixel.col(2).head<2>().setConstant(-0.5 * (factor - 1) / factor);
  XrayView view = *this;
  view.pixel_from_room = block_from_pixel * pixel_from_room;
  if (is_line_scan()) {  // its rows are not divided by the third coordinate
    const double middle = 0.5 * (factor - 1);
    view.pixel_from_room.row(1) = pixel_from_room.row(1) / factor;
    view.pixel_from_room(1, 3) -= middle / factor;
    view.source_room_mm = source_of_row_mm(middle);
    view.row_step_room_mm = factor * row_step_room_mm;
  }
  view.columns = columns / factor;
  view.rows = rows / factor;
  return view;
}

namespace {

// An image plane in the patient is where pixel sizes refer to, not where the panel stood: with SID = SAD, as files have
// it whose panel's distance is not known, half of the patient lies behind the plane. Rays go on to where no patient is.
// The camera is the same: a projection matrix has no scale.
void lengthen_rays(XrayView& view, double sad_mm) {
  constexpr double kLeastBehindMm = 250.0, kBehindMm = 1000.0;
  const double of_isocenter = view.pixel_from_room(2, 3);
  if ((1.0 / of_isocenter - 1.0) * sad_mm < kLeastBehindMm)
    view.pixel_from_room *= sad_mm / (sad_mm + kBehindMm) / of_isocenter;
}

}  // namespace

XrayView make_xray_view(const CarmGeometry& geometry, Beam beam) {
  const Eigen::Vector3d& u = geometry.row_direction;
  const Eigen::Vector3d& v = geometry.column_direction;
  // The position of a tilted plane is given before its tilt (PS3.3 C.8.8.2.7): turn it with the plane.
  Eigen::Vector3d first_pixel_receptor(geometry.position_mm.x(), geometry.position_mm.y(), 0.0);
  if (!geometry.normal_plane) {
    Eigen::Matrix3d tilt;
    tilt << u, -v, u.cross(-v);
    first_pixel_receptor = tilt * first_pixel_receptor;
  }

  // Pixel (c, r) lies at c U + r V + O in gantry coordinates, the source at (0, 0, SAD).
  const Eigen::Matrix3d gantry_from_receptor_axes = rotation_z(geometry.receptor_angle_rad);
  const Eigen::Vector3d source_gantry(0.0, 0.0, geometry.sad_mm);
  Eigen::Matrix3d gantry_from_pixel;
  gantry_from_pixel << gantry_from_receptor_axes * u * geometry.column_spacing_mm,
      gantry_from_receptor_axes * v * geometry.row_spacing_mm,
      gantry_from_receptor_axes * first_pixel_receptor + geometry.receptor_translation_mm - source_gantry;

  const Eigen::Matrix3d room_from_gantry = rotation_y(geometry.gantry_angle_rad);
  XrayView view;
  view.source_room_mm = room_from_gantry * source_gantry;
  view.pixel_from_room.leftCols<3>() = gantry_from_pixel.inverse() * room_from_gantry.transpose();
  view.pixel_from_room.col(3) = -view.pixel_from_room.leftCols<3>() * view.source_room_mm;
  view.columns = geometry.columns;
  view.rows = geometry.rows;
  view.beam = beam;
  lengthen_rays(view, geometry.sad_mm);
  return view;
}

XrayView make_line_scan_view(const LineScanGeometry& geometry, Beam beam) {
  // A point lies a columns, b rows and c ways away from the source of row 0: in row b, in column a / c.
  Eigen::Matrix3d from_source;
  from_source << geometry.sid_by_sad * geometry.column_step_room_mm, geometry.row_step_room_mm,
      geometry.sid_by_sad * (geometry.first_pixel_room_mm - geometry.source_room_mm);
  if (!(std::abs(from_source.determinant()) > 0.0))
    throw std::invalid_argument("the steps of a line scan and its rays lie in a plane");
  XrayView view;
  view.source_room_mm = geometry.source_room_mm;
  view.row_step_room_mm = geometry.row_step_room_mm;
  view.pixel_from_room.leftCols<3>() = from_source.inverse();
  view.pixel_from_room.col(3) = -view.pixel_from_room.leftCols<3>() * view.source_room_mm;
  view.columns = geometry.columns;
  view.rows = geometry.rows;
  view.beam = beam;
  return view;
}

XrayView xray_view_from_matrix(const Eigen::Matrix<double, 3, 4>& pixel_from_room, double sid_mm, int columns, int rows,
                               Beam beam) {
  const Eigen::Matrix3d turned = pixel_from_room.leftCols<3>();
  if (!pixel_from_room.allFinite() || !(std::abs(turned.determinant()) > 1e-12 * std::pow(turned.norm(), 3)))
    throw Error("the projection matrix has no source: its first three columns are not independent");
  // The third coordinate counts from 0 in the source to 1 on the receptor, along the receptor's normal.
  XrayView view{.pixel_from_room = pixel_from_room / (turned.row(2).norm() * sid_mm),
                .columns = columns,
                .rows = rows,
                .beam = beam};
  if (view.pixel_from_room(2, 3) < 0.0) view.pixel_from_room = -view.pixel_from_room;
  view.source_room_mm = -turned.inverse() * pixel_from_room.col(3);
  if (!(view.pixel_from_room(2, 3) > 0.0 && view.pixel_from_room(2, 3) < 1.0))
    throw Error(fmt::format(
        "the projection matrix and the SID of {} mm put the isocenter not between source and receptor", sid_mm));

  // A matrix of another unit of length has its source next to the isocenter, or far away.
  constexpr double kLeastShare = 0.1;
  if (view.pixel_from_room(2, 3) < kLeastShare)
    throw Error(fmt::format(
        "the projection matrix puts the isocenter {:.4g} mm from the source along the normal of the receptor, which is "
        "{} mm away: expected at least a tenth of that. Is the matrix of mm?",
        view.pixel_from_room(2, 3) * sid_mm, sid_mm));

  // Any matrix has a camera; that of an X-ray has pixels such as receptors have.
  constexpr double kMinPitchMm = 0.05, kMaxPitchMm = 6.0, kMaxCosine = 0.01, kMaxPitchRatio = 2.0;
  const Eigen::Matrix3d receptor_from_pixel = view.pixel_from_room.leftCols<3>().inverse();
  const Eigen::Vector3d column_step = receptor_from_pixel.col(0), row_step = receptor_from_pixel.col(1);
  const auto [small_mm, large_mm] = std::minmax({column_step.norm(), row_step.norm()});
  const double cosine = column_step.normalized().dot(row_step.normalized());
  if (small_mm < kMinPitchMm || large_mm > kMaxPitchMm || large_mm > kMaxPitchRatio * small_mm ||
      std::abs(cosine) > kMaxCosine)
    throw Error(fmt::format(
        "the projection matrix and the SID of {} mm make pixels of {:.4g} x {:.4g} mm whose edges meet at {:.1f} "
        "degrees, expected {} to {} mm, of sizes alike and at right angles",
        sid_mm, column_step.norm(), row_step.norm(), deg_from_rad(std::acos(std::clamp(cosine, -1.0, 1.0))),
        kMinPitchMm, kMaxPitchMm));
  return view;
}

}  // namespace isoshift
