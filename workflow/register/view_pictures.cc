#include "workflow/register/view_pictures.h"

#include <algorithm>

#include "registration/preprocess/image_operations.h"
#include "registration/region.h"

namespace isoshift {
namespace {

constexpr int kMaxEdge = 640;

// An arrow as a closed line: its head is a triangle.
Polygon arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& tip) {
  constexpr double kLongestHeadPx = 12.0;
  const Eigen::Vector2d way = tip - from;
  const Eigen::Vector2d back = -std::min(0.5, kLongestHeadPx / way.norm()) * way;
  const Eigen::Vector2d aside = 0.4 * Eigen::Vector2d(-back.y(), back.x());
  return {tip + back + aside, tip, from, tip, tip + back - aside};
}

}  // namespace

std::vector<Polygon> silhouette(const ProjectedRegion& region, const XrayView& view,
                                const Eigen::Isometry3d& room_from_patient) {
  FixedImage shadow{.view = view,
                    .line_integral = Image<float>(view.columns, view.rows),
                    .field = Image<std::uint8_t>(view.columns, view.rows, 1)};
  region.restrict(shadow, room_from_patient, 0.0);
  return outlines(shadow.field);
}

Eigen::Matrix<double, 2, 3> pixels_of_steps(const XrayView& view, const Eigen::Matrix3d& steps_room_mm) {
  const Eigen::Vector2d isocenter = view.project(Eigen::Vector3d::Zero()).value();
  Eigen::Matrix<double, 2, 3> steps_px;
  for (int step = 0; step < 3; ++step) steps_px.col(step) = view.project(steps_room_mm.col(step)).value() - isocenter;
  return steps_px;
}

std::array<std::string, 4> directions_at_edges(const XrayView& view, const Eigen::Isometry3d& room_from_patient) {
  constexpr double kStepMm = 10.0;
  const Eigen::Matrix<double, 2, 3> pixels_from_patient = pixels_of_steps(view, kStepMm * room_from_patient.linear());
  const Eigen::Vector3d right = pixels_from_patient.row(0), down = pixels_from_patient.row(1);
  return {orientation_letters(-right), orientation_letters(right), orientation_letters(-down),
          orientation_letters(down)};
}

std::vector<Polygon> motion_arrows(const XrayView& view, std::span<const BodyMotion> bodies,
                                   const Eigen::Isometry3d& setup_error) {
  constexpr double kLeastMm = 1.0;
  std::vector<Polygon> arrows;
  for (const BodyMotion& body : bodies) {
    if (body.breathes || !body.is_determined() || body.displacement_mm.norm() < kLeastMm) continue;
    const auto from = view.project(setup_error * body.center_room_mm);
    const auto tip = view.project(setup_error * (body.center_room_mm + kMotionMagnified * body.displacement_mm));
    // Motion toward the source is not seen.
    if (from && tip && (*tip - *from).norm() > kLeastMm * kMotionMagnified * pixels_per_mm(view))
      arrows.push_back(arrow(*from, *tip));
  }
  return arrows;
}

std::vector<ViewPicture> view_pictures(const Study& study, std::span<const FixedImage> images, Renderer& renderer,
                                       const std::vector<MarkedStructure>& structures,
                                       const Eigen::Isometry3d& actual_room_from_patient,
                                       std::span<const BodyMotion> bodies) {
  std::vector<ProjectedRegion> regions;
  regions.reserve(structures.size());
  for (const MarkedStructure& structure : structures)
    regions.emplace_back(RegionOfInterest{.volume = structure.mask, .excluded = {}, .cut_ends = {}});
  const std::array poses = {study.planned_room_from_patient, actual_room_from_patient};
  std::vector<ViewPicture> pictures;
  for (const FixedImage& whole : images) {
    const int factor = (std::max(whole.view.columns, whole.view.rows) + kMaxEdge - 1) / kMaxEdge;
    const FixedImage image = reduced(whole, factor);
    const RenderResult drrs = renderer.render(std::span(&image.view, 1), poses, PixelSet::all());
    ViewPicture& picture = pictures.emplace_back();
    put_grays(picture, image.line_integral, image_of(image.view, drrs.line_integrals(0, 0)),
              image_of(image.view, drrs.line_integrals(1, 0)), image.field);
    picture.field = outlines(image.field);
    picture.moved = motion_arrows(image.view, bodies,
                                  setup_error_from_poses(study.planned_room_from_patient, actual_room_from_patient));
    picture.isocenter_px = image.view.project(Eigen::Vector3d::Zero()).value();
    picture.pixels_per_mm = pixels_per_mm(image.view);
    picture.directions = directions_at_edges(image.view, study.planned_room_from_patient);
    for (std::size_t n = 0; n < structures.size(); ++n)
      picture.structures.push_back({.name = structures[n].name,
                                    .planned = silhouette(regions[n], image.view, poses[0]),
                                    .found = silhouette(regions[n], image.view, poses[1])});
  }
  return pictures;
}

}  // namespace isoshift
