#include "drr/camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "base/error.h"
#include "base/option_name.h"

namespace isoshift {

namespace {

Eigen::Matrix4d matrix_of(const Eigen::Matrix3d& way_from_pixel, const Eigen::Vector3d& source) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = way_from_pixel;
  matrix.topRightCorner<3, 1>() = source;
  return matrix;
}

}  // namespace

Eigen::Matrix4d Camera::matrix() const { return matrix_of(way_voxel_from_pixel, source_voxel); }
Eigen::Matrix4d Camera::room_matrix() const { return matrix_of(way_room_from_pixel, source_room_mm); }

Camera make_camera(const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                   const Eigen::Affine3d& voxel_from_patient) {
  const Eigen::Isometry3d patient_from_room = room_from_patient.inverse();
  const Eigen::Matrix3d voxel_from_room_axes = voxel_from_patient.linear() * patient_from_room.linear();
  Eigen::Matrix3d way_room_from_pixel = view.pixel_from_room.leftCols<3>().inverse();
  if (view.is_line_scan()) way_room_from_pixel.col(1).setZero();  // the same way in all rows
  return {.source_voxel = voxel_from_patient * (patient_from_room * view.source_room_mm),
          .row_step_voxel = voxel_from_room_axes * view.row_step_room_mm,
          .way_voxel_from_pixel = voxel_from_room_axes * way_room_from_pixel,
          .source_room_mm = view.source_room_mm,
          .row_step_room_mm = view.row_step_room_mm,
          .way_room_from_pixel = way_room_from_pixel,
          .voxel_from_room_axes = voxel_from_room_axes};
}

void refuse_line_scans(std::span<const XrayView> views, RendererKind kind) {
  if (std::ranges::any_of(views, &XrayView::is_line_scan))
    throw UsageError(
        fmt::format("{} cannot render line scans; cpu and raycast can", option("renderer", to_string(kind))));
}

std::vector<std::size_t> checked_view_begins(std::span<const XrayView> views,
                                             std::span<const Eigen::Isometry3d> room_from_patient,
                                             const PixelSet& pixels) {
  for (const Eigen::Isometry3d& pose : room_from_patient)
    if (!pose.matrix().allFinite()) throw std::invalid_argument("a pose to render is not finite");
  if (!pixels.of_view.empty() && pixels.of_view.size() != views.size())
    throw std::invalid_argument("there is not one list of pixels per view");
  for (std::size_t v = 0; v < pixels.of_view.size(); ++v)
    for (const std::uint32_t pixel : pixels.of_view[v])
      if (pixel >= static_cast<std::uint64_t>(views[v].columns) * views[v].rows)
        throw std::invalid_argument("a pixel to render lies outside of its view");
  std::vector<std::size_t> begins = {0};
  for (std::size_t v = 0; v < views.size(); ++v) begins.push_back(begins.back() + pixels.count(views, v));
  return begins;
}

}  // namespace isoshift
