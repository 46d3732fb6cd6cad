#include "drr/camera.h"

namespace isoshift {

Camera make_camera(const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                   const Eigen::Affine3d& voxel_from_patient) {
  const Eigen::Isometry3d patient_from_room = room_from_patient.inverse();
  const Eigen::Matrix3d voxel_from_room_axes = voxel_from_patient.linear() * patient_from_room.linear();
  return {.source_voxel = voxel_from_patient * (patient_from_room * view.source_room_mm),
          .way_voxel_from_pixel = voxel_from_room_axes * view.pixel_from_room.leftCols<3>().inverse()};
}

std::vector<std::size_t> view_begins(std::span<const XrayView> views, const PixelSet& pixels) {
  std::vector<std::size_t> begins = {0};
  for (std::size_t v = 0; v < views.size(); ++v) begins.push_back(begins.back() + pixels.count(views, v));
  return begins;
}

}  // namespace isoshift
