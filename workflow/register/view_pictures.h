#pragma once
// The pictures of a result's views: X-ray, DRR at the planned pose and at the pose found, and their marks.

#include <span>
#include <vector>

#include "drr/renderer.h"
#include "io/report/view_picture.h"
#include "io/study/study.h"
#include "registration/preprocess/preprocess.h"

namespace isoshift {

struct MarkedStructure {
  std::string name;
  Volume<std::uint8_t> mask;  // in the CT's voxels
};

// One picture per view, reduced to at most 640 pixels along an edge. `images`: the prepared X-ray of each view.
std::vector<ViewPicture> view_pictures(const Study& study, std::span<const FixedImage> images, Renderer& renderer,
                                       const std::vector<MarkedStructure>& structures,
                                       const Eigen::Isometry3d& actual_room_from_patient);

}  // namespace isoshift
