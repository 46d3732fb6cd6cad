#pragma once
// The pictures of a result's views: X-ray, DRR at the planned pose and at the pose found, and their marks.

#include <array>
#include <span>
#include <string>
#include <vector>

#include "drr/renderer.h"
#include "io/report/view_picture.h"
#include "io/study/study.h"
#include "registration/preprocess/preprocess.h"
#include "registration/region.h"
#include "setup/registration.h"

namespace isoshift {

struct MarkedStructure {
  std::string name;
  Volume<std::uint8_t> mask;  // in the CT's voxels
};

// Where steps in the room (a column each, mm) take a point on the image that lies at the isocenter: columns and rows.
Eigen::Matrix<double, 2, 3> pixels_of_steps(const XrayView& view, const Eigen::Matrix3d& steps_room_mm);

// The outlines of a region on an image.
std::vector<Polygon> silhouette(const ProjectedRegion& region, const XrayView& view,
                                const Eigen::Isometry3d& room_from_patient);

// The directions of the patient at the left, right, upper and lower edge of the image: "R", "LA".
std::array<std::string, 4> directions_at_edges(const XrayView& view, const Eigen::Isometry3d& room_from_patient);

// How bones lie off once the target is right, seen in a view: arrows as closed lines, kMotionMagnified times as long as
// the motion. What breathes lies elsewhere in every view and is left out, as is what is not determined or has hardly
// moved.
std::vector<Polygon> motion_arrows(const XrayView& view, std::span<const BodyMotion> bodies,
                                   const Eigen::Isometry3d& setup_error);

// One picture per view, reduced to at most 640 pixels along an edge. `images`: the prepared X-ray of each view.
// `bodies`: what bones did against the target, whose pose `actual_room_from_patient` is.
std::vector<ViewPicture> view_pictures(const Study& study, std::span<const FixedImage> images, Renderer& renderer,
                                       const std::vector<MarkedStructure>& structures,
                                       const Eigen::Isometry3d& actual_room_from_patient,
                                       std::span<const BodyMotion> bodies);

}  // namespace isoshift
