#pragma once
// One X-ray exposure as a camera in room coordinates: a pinhole, or a line scan, whose rows are pinholes of their own.

#include <Eigen/Geometry>
#include <array>
#include <optional>

namespace isoshift {

// Radiation quality; it chooses the attenuation curve of the DRR (docs/algorithms.md).
enum class Beam { kKilovoltage, kMegavoltage };
inline constexpr std::array kBeams = {Beam::kKilovoltage, Beam::kMegavoltage};

// From the source to the center of a pixel on the receptor, both in mm in the room. Where the image plane lies within
// 250 mm behind the isocenter, thus in the patient, the ray ends 1 m behind the isocenter instead.
struct Ray {
  Eigen::Vector3d source_room_mm;
  Eigen::Vector3d pixel_room_mm;
};

// The camera of one X-ray image. Pixel centers lie at integer (column, row). The matrix is scaled so that the third
// homogeneous coordinate is the fraction of the ray (0 source, 1 end of the ray). Of a line scan the first coordinate
// is the column times the third, as of a pinhole, but the second is the row itself.
struct XrayView {
  Eigen::Matrix<double, 3, 4> pixel_from_room = Eigen::Matrix<double, 3, 4>::Zero();
  Eigen::Vector3d source_room_mm = Eigen::Vector3d::Zero();    // of row 0
  Eigen::Vector3d row_step_room_mm = Eigen::Vector3d::Zero();  // of a line scan, from row to row; 0 of a pinhole
  int columns = 0;
  int rows = 0;
  Beam beam = Beam::kKilovoltage;

  bool is_line_scan() const { return !row_step_room_mm.isZero(0.0); }
  Eigen::Vector3d source_of_row_mm(double row) const { return source_room_mm + row * row_step_room_mm; }
  // Where the source is when the ray through a room point is measured.
  Eigen::Vector3d source_for_mm(const Eigen::Vector3d& point_room_mm) const;

  // (column, row) of a room point; nothing for a point at or behind the source.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_room_mm) const;

  // The ray that project() maps to (column, row).
  Ray ray(double column, double row) const;

  // Unit vector from the source through the isocenter (the origin of the room).
  Eigen::Vector3d central_direction_room() const { return -source_for_mm(Eigen::Vector3d::Zero()).normalized(); }

  // The same receptor read out in blocks of factor x factor pixels; an incomplete last block is dropped.
  XrayView downscaled(int factor) const;
};

// A linac's imager in the attributes of an RT Image (PS3.3 C.8.8.2), angles in radians, lengths in mm.
struct CarmGeometry {
  double sad_mm = 0.0;                                                // RadiationMachineSAD
  double gantry_angle_rad = 0.0;                                      // GantryAngle, about fixed y
  Eigen::Vector3d receptor_translation_mm = Eigen::Vector3d::Zero();  // XRayImageReceptorTranslation, IEC gantry
  double receptor_angle_rad = 0.0;                                    // XRayImageReceptorAngle, about receptor z
  Eigen::Vector3d row_direction = Eigen::Vector3d::UnitX();           // RTImageOrientation, first three
  Eigen::Vector3d column_direction = -Eigen::Vector3d::UnitY();       // RTImageOrientation, last three
  bool normal_plane = true;                                           // RTImagePlane is NORMAL
  double column_spacing_mm = 0.0;                                     // ImagePlanePixelSpacing, second value
  double row_spacing_mm = 0.0;                                        // ImagePlanePixelSpacing, first value
  Eigen::Vector2d position_mm = Eigen::Vector2d::Zero();              // RTImagePosition: center of the first pixel
  int columns = 0;
  int rows = 0;
};

XrayView make_xray_view(const CarmGeometry& geometry, Beam beam);

// A CT's localizer: the table moves through the fan of a tube that stands still. What its file says holds in the plane
// through the axis about which the gantry turns; the fan's rays have no component along the table (line scan).
struct LineScanGeometry {
  Eigen::Vector3d source_room_mm = Eigen::Vector3d::Zero();       // of row 0
  Eigen::Vector3d first_pixel_room_mm = Eigen::Vector3d::Zero();  // its center, in the plane
  Eigen::Vector3d column_step_room_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d row_step_room_mm = Eigen::Vector3d::Zero();
  double sid_by_sad = 0.0;  // of the detectors and the plane
  int columns = 0;
  int rows = 0;
};

// Throws std::invalid_argument if the steps and the way from source to first pixel lie in a plane.
XrayView make_line_scan_view(const LineScanGeometry& geometry, Beam beam);

// The view of any other imager, by its projection matrix (up to scale) and the distance of its receptor plane from the
// source. Throws Error for a matrix without a source, if the isocenter does not lie between source and receptor, or for
// pixels that no receptor has: smaller than 0.05 mm, larger than 6 mm, oblique, or more than twice as long as wide.
XrayView xray_view_from_matrix(const Eigen::Matrix<double, 3, 4>& pixel_from_room, double sid_mm, int columns, int rows,
                               Beam beam);

}  // namespace isoshift
