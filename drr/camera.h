#pragma once
// One pose and view, ready to turn pixels into rays through the voxel lattice. What every renderer starts from.

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "drr/renderer.h"
#include "geometry/xray_view.h"

namespace isoshift {

struct Camera {
  Eigen::Vector3d source_voxel;          // in continuous voxel indices; of a line scan that of row 0
  Eigen::Vector3d row_step_voxel;        // of a line scan, from row to row; else 0
  Eigen::Matrix3d way_voxel_from_pixel;  // (column, row, 1) to the way from the source to that pixel's center

  // The same in the room, and directions of the room in voxels.
  Eigen::Vector3d source_room_mm;
  Eigen::Vector3d row_step_room_mm;
  Eigen::Matrix3d way_room_from_pixel;
  Eigen::Matrix3d voxel_from_room_axes;

  // As shaders take it: (column, row, 1, 0) to the way, (0, 0, 0, 1) to the source; in voxels, and in the room.
  Eigen::Matrix4d matrix() const;
  Eigen::Matrix4d room_matrix() const;
};

// Throws UsageError for a line scan: what every renderer of pinholes alone begins with.
void refuse_line_scans(std::span<const XrayView> views, RendererKind kind);

Camera make_camera(const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                   const Eigen::Affine3d& voxel_from_patient);

// Where each view's pixels begin among those of one pose; the last entry is their number. What every render() begins
// with: throws std::invalid_argument for a pose that is not finite or a pixel outside of its view.
std::vector<std::size_t> checked_view_begins(std::span<const XrayView> views,
                                             std::span<const Eigen::Isometry3d> room_from_patient,
                                             const PixelSet& pixels);

}  // namespace isoshift
