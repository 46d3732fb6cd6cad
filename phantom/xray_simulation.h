#pragma once
// X-rays of analytic shapes, made without anything that registers them: no XrayView, no projection matrix, no renderer,
// no voxels. Source and pixels are written down in IEC 61217 fixed coordinates, so that a wrong sign in the rest of the
// program cannot cancel here.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/image.h"
#include "phantom/shapes.h"

namespace isoshift {

// How the patient really lies. Angles in degrees, as one would say them.
struct Placement {
  std::string patient_position = "HFS";  // HFS, HFP, FFS, FFP, HFDR, HFDL, FFDR, FFDL
  double couch_angle_deg = 0.0;          // counter-clockwise seen from above
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();  // setup error in IEC 61217 fixed: planned x is found at
  Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();    // R x + t, R = Rz(rz) Rx(rx) Ry(ry), given as (rx, ry, rz)

  // R of the setup error.
  Eigen::Matrix3d rotation() const;
  // The patient point that lies at a point of the room, and the way back. Throws UsageError for an unknown position.
  Eigen::Vector3d patient_from_fixed(const Eigen::Vector3d& point_fixed_mm) const;
  Eigen::Vector3d fixed_from_patient(const Eigen::Vector3d& point_patient_mm) const;
};

// How the panel really lies against what the X-rays' files say, along and about the gantry's axes: x to the right and
// y toward the gantry with the source at the top, z toward the source. First it is turned about its center, by y, then
// x, then z.
struct PanelFault {
  Eigen::Vector2d shift_mm = Eigen::Vector2d::Zero();  // along x, y
  Eigen::Vector3d turn_deg = Eigen::Vector3d::Zero();  // about x, y (tilts), z (the panel's roll)
};

// An imager at some gantry angle, its panel perpendicular to the central ray and centered on it.
struct Imager {
  double gantry_angle_deg = 0.0;  // clockwise seen facing the gantry: 90 puts the source at the viewer's right
  double sad_mm = 1000.0;
  double sid_mm = 1500.0;
  int pixels = 512;                 // along each edge
  double pixel_mm = 0.8;            // on the panel
  double receptor_angle_deg = 0.0;  // the panel's turn about the central ray, counter-clockwise seen from the source
  double scatter_share = 0.12;      // of the primary beam, reaching the panel blurred
  bool is_megavoltage = false;      // 6 MV instead of 120 kVp
  PanelFault fault;

  Eigen::Vector3d source_fixed_mm() const;
  // Center of a pixel; column 0 at the left and row 0 at the top, seen from the source with the gantry at the top.
  Eigen::Vector3d pixel_fixed_mm(double column, double row) const;
};

// Intensity at the panel, 1 without a patient: a 120 kVp spectrum through water and bone, a focal spot of 0.6 mm,
// scatter and the noise of `photons` per open pixel (0: none).
Image<float> simulate_xray(const std::vector<Shape>& shapes, const Placement& placement, const Imager& imager,
                           double photons, std::uint64_t seed);

}  // namespace isoshift
