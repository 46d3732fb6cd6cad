#pragma once
// What the benchmarks render and register: the head phantom at the sizes of a treatment room.

#include <vector>

#include "drr/renderer.h"
#include "geometry/rotation.h"
#include "geometry/xray_image.h"
#include "phantom/xray_simulation.h"

namespace isoshift {

// A CT of 190 x 230 x 216 mm with voxels of 0.5 x 0.5 x 1.0 mm (380 x 460 x 216): a head at the resolution of a
// planning CT.
inline Volume<float> bench_ct() {
  const Eigen::Vector3i size(380, 460, 216);
  const Eigen::Vector3d spacing_mm(0.5, 0.5, 1.0);
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.linear() = spacing_mm.asDiagonal();
  patient_from_voxel.translation() = -0.5 * (size.cast<double>().cwiseProduct(spacing_mm) - spacing_mm);
  return ct_of_shapes(head_phantom(Eigen::Vector3d::Zero(), 1), size, patient_from_voxel);
}

// A kV panel of 410 mm at SID 1500 mm with `pixels` along each edge; 768 is that of a current linac in half resolution.
inline XrayView bench_view(double gantry_deg, int pixels) {
  CarmGeometry geometry;
  geometry.sad_mm = 1000.0;
  geometry.gantry_angle_rad = rad_from_deg(gantry_deg);
  geometry.receptor_translation_mm = Eigen::Vector3d(0, 0, -500);
  geometry.column_spacing_mm = geometry.row_spacing_mm = 410.0 / pixels;
  geometry.position_mm = 0.5 * (pixels - 1) * geometry.row_spacing_mm * Eigen::Vector2d(-1, 1);
  geometry.columns = geometry.rows = pixels;
  return make_xray_view(geometry, Beam::kKilovoltage);
}

}  // namespace isoshift
