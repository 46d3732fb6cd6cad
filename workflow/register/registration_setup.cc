#include "workflow/register/registration_setup.h"

#include <algorithm>
#include <cstdint>

#include "geometry/rotation.h"
#include "registration/imager/imager_effect.h"

namespace isoshift {

void RegistrationRequest::settle() {
  search.registration().check();
  if (search.is_paper()) rendering.default_to_paper();
  rendering.check();
}

std::shared_ptr<const RendererPyramid> RendererStore::get(const RenderingOptions& rendering,
                                                          const std::shared_ptr<const CtSeries>& ct,
                                                          const std::vector<Beam>& beams) {
  if (!last_ || ct != ct_ || beams != beams_) {
    last_.reset();  // never two in memory
    last_ = std::make_shared<const RendererPyramid>(rendering.kind(), ct->hu, rendering.model(), beams,
                                                    rendering.options());
    ct_ = ct;
    beams_ = beams;
  }
  return last_;
}

namespace {

// What machine profiles say of the imagers; nothing: they say nothing.
std::optional<Uncertainty> uncertainty_by_imagers(const Study& study, Dof dof) {
  if (std::ranges::none_of(study.rt_images, [](const RtImage& image) { return image.imager.has_value(); }))
    return std::nullopt;
  std::vector<ImagerInView> views;
  for (std::size_t n = 0; n < study.xrays.size(); ++n) {
    const RtImage& header = study.rt_images[n];
    if (header.pixel_from_room) continue;  // where its gantry stands is not known
    views.push_back({.model = ImagerModel(study.xrays[n].view, rad_from_deg(header.gantry_angle_deg.value()),
                                          header.sid_mm.value()),
                     .pixels_per_mm = pixels_per_mm(study.xrays[n].view),
                     .imager = header.imager.value_or(KnownImager{.number = SIZE_MAX})});
  }
  return uncertainty_by_imagers(views, dof);
}

}  // namespace

RegistrationSetup::RegistrationSetup(const RegistrationRequest& request, const Study& study,
                                     const std::vector<Beam>& beams, RendererStore& store)
    : ct_(study.ct), options_(request.search.registration()) {
  RegionOfStudy of_study = region_of(request.region, study, request.rendering.threshold_hu);
  region_ct_ = std::move(of_study.region.rendered_ct);
  if (region_ct_)
    renderers_ = std::make_shared<const RendererPyramid>(request.rendering.kind(), *region_ct_,
                                                         request.rendering.model(), beams, request.rendering.options());
  else
    renderers_ = store.get(request.rendering, study.ct, beams);
  options_.region = std::make_shared<const ProjectedRegion>(std::move(of_study.region.projected));
  chosen_ = std::move(of_study.chosen);
  // X-rays show what lies before and behind a volume of interest, DRRs of that volume do not: intensities cannot be
  // compared, edges can.
  if (options_.region->has_volume() && !request.search.is_paper())
    for (Stage& stage : options_.stages) stage.similarity = SimilarityKind::kGradientCorrelation;
  options_.by_imagers = uncertainty_by_imagers(study, options_.dof);
  options_.rectangles = request.region.rectangles_of(study);
}

TargetProblem target_problem(const Study& study, const RegistrationRequest& request, const RegistrationSetup& setup,
                             const TargetChoice& choice, const Surrogate& surrogate) {
  TargetProblem problem{
      .patient = planned_patient(study),
      .target = choice.target,
      .surrogate = surrogate,
      .others = [&study, name = choice.target.name] { return structures_beside(name, study); },
      .chosen = setup.chosen(),
      .margin_mm = request.region.margin_mm,
      .rendering = {.kind = request.rendering.kind(),
                    .model = request.rendering.model(),
                    .options = request.rendering.options(),
                    .beams = beams_of(study)},
      .options = setup.options(),
  };
  for (const std::string& doubt : study.doubts) problem.findings.push_back({.check = Check::kFiles, .words = doubt});
  for (const std::string& doubt : choice.doubts) problem.findings.push_back({.check = Check::kTarget, .words = doubt});
  return problem;
}

}  // namespace isoshift
