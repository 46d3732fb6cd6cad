#pragma once
// One pose and view, ready to turn pixels into rays through the voxel lattice. What every renderer starts from.

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "drr/renderer.h"
#include "geometry/xray_view.h"

namespace isoshift {

struct Camera {
  Eigen::Vector3d source_voxel;          // in continuous voxel indices
  Eigen::Matrix3d way_voxel_from_pixel;  // (column, row, 1) to the way from the source to that pixel's center
};

Camera make_camera(const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                   const Eigen::Affine3d& voxel_from_patient);

// Where each view's pixels begin among those of one pose; the last entry is their number.
std::vector<std::size_t> view_begins(std::span<const XrayView> views, const PixelSet& pixels);

}  // namespace isoshift
