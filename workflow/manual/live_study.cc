#include "workflow/manual/live_study.h"

#include <algorithm>
#include <cmath>

#include "io/dicom/structure_mask.h"
#include "registration/preprocess/image_operations.h"
#include "workflow/register/study_bodies.h"
#include "workflow/register/view_pictures.h"

namespace isoshift {
namespace {

constexpr int kMaxEdge = 512;

Study loaded(const StudyOptions& options, Observer& observer) {
  Notes notes;
  Study study = load(options, notes, observer);
  for (const std::string& warning : notes.warnings) observer.say("warning: " + warning);
  return study;
}

LiveStudy::View view_of(const FixedImage& image, int block, const Eigen::Isometry3d& planned_room_from_patient) {
  LiveStudy::View view{.label = image.label,
                       .xray = GrayScale::of(image.line_integral, image.field)(image.line_integral),
                       .isocenter_px = image.view.project(Eigen::Vector3d::Zero()).value(),
                       .px_per_mm = pixels_of_steps(image.view, Eigen::Matrix3d::Identity()),
                       .from_source = image.view.central_direction_room(),
                       .field = outlines(image.field),
                       .block = block,
                       .directions = directions_at_edges(image.view, planned_room_from_patient)};
  return view;
}

}  // namespace

LiveStudy::LiveStudy(const StudyOptions& options, Observer& observer) : study_(loaded(options, observer)) {
  renderers_ =
      std::make_unique<RendererPyramid>(RendererKind::kCpu, study_.ct->hu, AttenuationModel{}, beams_of(study_));
  std::vector<FixedImage> images = prepared(study_.xrays);
  for (FixedImage& image : images) {
    const int edge = std::max(image.view.columns, image.view.rows);
    const int block = (edge + kMaxEdge - 1) / kMaxEdge;
    image = reduced(image, block);
    views_.push_back(view_of(image, block, study_.planned_room_from_patient));
  }
  int factor = 1;
  for (Level& level : levels_) {
    double pixel_mm = 0.0;
    for (const FixedImage& image : images) {
      const XrayView& camera = level.cameras.emplace_back(image.view.downscaled(factor));
      pixel_mm = std::max(pixel_mm, 1.0 / pixels_per_mm(camera));
    }
    level.renderer = factor == 1 ? &renderers_->finest() : &renderers_->with_voxels_up_to(pixel_mm);
    factor *= 2;
  }
  const std::vector<Image<float>> planned = line_integrals(Eigen::Isometry3d::Identity(), levels_.front());
  for (std::size_t n = 0; n < images.size(); ++n)
    grays_.push_back(GrayScale::like(planned[n], views_[n].xray, images[n].field));
  observer.progress("finding bodies", 0.0);
  find_parts();
}

void LiveStudy::find_parts() {
  const RtStructures* const structures = study_.structures ? &*study_.structures : nullptr;
  if (structures != nullptr)
    for (const Structure& structure : structures->structures) {
      if (structure.contours.empty()) continue;
      structures_.push_back(structure.name);
      parts_.push_back({"structure " + structure.name, {"--structure", structure.name}});
    }
  bodies_ = bodies_of(*study_.ct, structures);
  for (int number = 1; number <= static_cast<int>(bodies_.bodies.size()); ++number) {
    if (bodies_.bodies[static_cast<std::size_t>(number - 1)].kind == Body::Kind::kCouch) continue;
    body_numbers_.push_back(number);
    parts_.push_back({body_in_words(bodies_, number), {"--body", std::to_string(number)}});
  }
}

Volume<std::uint8_t> LiveStudy::mask_of_part(std::size_t part) const {
  const Volume<float>& ct = study_.ct->hu;
  if (part < structures_.size())
    return mask_of(structure_named(*study_.structures, structures_[part]), ct.size, ct.patient_from_voxel);
  return body_mask(bodies_, body_numbers_.at(part - structures_.size()), ct);
}

std::shared_ptr<const ProjectedRegion> LiveStudy::region_of_part(std::size_t part) const {
  const std::lock_guard lock(shown_mutex_);
  if (!shown_.region || shown_.part != part) {
    shown_.region.reset();  // never two in memory
    shown_ = {.part = part,
              .region = std::make_shared<const ProjectedRegion>(
                  RegionOfInterest{.volume = mask_of_part(part), .excluded = {}, .cut_ends = {}})};
  }
  return shown_.region;
}

std::vector<std::vector<Polygon>> LiveStudy::outlines_of(std::size_t part, const Eigen::Isometry3d& setup_error) const {
  const std::shared_ptr<const ProjectedRegion> region = region_of_part(part);
  std::vector<std::vector<Polygon>> outlines;
  for (const XrayView& camera : cameras())
    outlines.push_back(silhouette(*region, camera, setup_error * study_.planned_room_from_patient));
  return outlines;
}

std::vector<Image<float>> LiveStudy::line_integrals(const Eigen::Isometry3d& setup_error, const Level& level) const {
  const std::array poses = {Eigen::Isometry3d(setup_error * study_.planned_room_from_patient)};
  const RenderResult drrs = level.renderer->render(level.cameras, poses, PixelSet::all());
  std::vector<Image<float>> images;
  images.reserve(level.cameras.size());
  for (std::size_t view = 0; view < level.cameras.size(); ++view)
    images.push_back(image_of(level.cameras[view], drrs.line_integrals(0, view)));
  return images;
}

std::vector<Image<std::uint8_t>> LiveStudy::drrs(const Eigen::Isometry3d& setup_error, Detail detail) const {
  const std::vector<Image<float>> images = line_integrals(setup_error, levels_[static_cast<std::size_t>(detail)]);
  std::vector<Image<std::uint8_t>> pictures;
  pictures.reserve(images.size());
  for (std::size_t view = 0; view < images.size(); ++view) pictures.push_back(grays_[view](images[view]));
  return pictures;
}

}  // namespace isoshift
