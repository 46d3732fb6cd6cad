#include "workflow/register/target_registration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "drr/spot_check.h"
#include "registration/bodies/target_match.h"
#include "registration/quality/findings.h"
#include "registration/quality/limits.h"
#include "setup/irradiated_field.h"
#include "workflow/register/region_check.h"

namespace isoshift {
namespace {

// A target near the edge of what a view shows is cut off with what could tell where it lies.
void doubt_at_edges_of_fields(std::span<const FixedImage> images, const Eigen::Vector3d& target_room_mm,
                              RegistrationResult& found) {
  for (std::size_t view = 0; view < images.size(); ++view) {
    const auto place_px = images[view].view.project(target_room_mm);
    if (!place_px) continue;
    const double inside_mm = inside_px(found.views[view].field, *place_px) / pixels_per_mm(images[view].view);
    if (inside_mm >= limits::kLeastInsideMm) continue;
    const Measure measure{.value = inside_mm, .limit = limits::kLeastInsideMm, .unit = "mm"};
    found.findings.push_back({.check = inside_mm < 0.0 ? Check::kTargetOutsideField : Check::kTargetAtEdgeOfField,
                              .view = name_of_view(images[view].label, view),
                              .measures = {measure}});
  }
}

void doubt_at_edges_of_rectangles(std::span<const FixedImage> images, const RectanglesByLabel& rectangles,
                                  const Eigen::Vector3d& target_room_mm, RegistrationResult& found) {
  for (const FixedImage& image : images) {
    const auto of_view = rectangles.find(image.label);
    const auto place_px = image.view.project(target_room_mm);
    if (of_view == rectangles.end() || !place_px) continue;
    const PixelRectangle& r = of_view->second;
    const double inside_mm = std::min({place_px->x() - r.first_column, r.last_column - place_px->x(),
                                       place_px->y() - r.first_row, r.last_row - place_px->y()}) /
                             pixels_per_mm(image.view);
    if (inside_mm >= limits::kLeastInsideMm) continue;
    const Measure measure{.value = std::abs(inside_mm), .limit = limits::kLeastInsideMm, .unit = "mm"};
    found.findings.push_back(
        {.check = inside_mm < 0.0 ? Check::kTargetOutsideRectangle : Check::kTargetAtEdgeOfRectangle,
         .view = image.label,
         .measures = {measure}});
  }
}

}  // namespace

TargetRegistration::TargetRegistration(const Study& study, const RegistrationRequest& request,
                                       const RegistrationSetup& setup, const TargetChoice& choice,
                                       const Surrogate& surrogate, BodyStore& bodies)
    : study_(study),
      request_(request),
      setup_(setup),
      choice_(choice),
      surrogate_(surrogate),
      bodies_(bodies),
      options_(setup.options()) {
  options_.target_patient_mm = study.planned_room_from_patient.inverse() * choice.target.center_room_mm;
  region_doubts_ = region_doubts(study, setup.chosen(), request.region.margin_mm, choice.target, surrogate.drawn);
}

const BentPatient& TargetRegistration::bent_patient() const {
  std::call_once(bent_once_, [&] {
    PatientBodies parts =
        patient_bodies(*bodies_.map(study_.ct), *bodies_.masks(study_.ct), *options_.target_patient_mm);
    if (surrogate_.drawn) {
      parts.named_carriers = shares_of_bone_in(parts, *surrogate_.drawn);
      if (parts.named_carriers.empty())
        throw Error(fmt::format("surrogate: the CT shows no bone in it ({})", surrogate_.words));
    }
    bent_.emplace(study_.ct->hu, request_.rendering.model(), beams_of(study_), std::move(parts), choice_.target,
                  structures_beside(choice_.target.name, study_));
  });
  return *bent_;
}

const TargetRegistration::OwnBall& TargetRegistration::own_ball() const {
  std::call_once(ball_once_, [&] {
    const RenderingOptions& rendering = request_.rendering;
    RegionOfStudy region = ball_about(*options_.target_patient_mm, kAboutTargetMm, setup_.chosen(), request_.region,
                                      study_, rendering.threshold_hu);
    ball_.emplace();
    if (region.rendered_ct)
      ball_->renderers.emplace(rendering.kind(), *region.rendered_ct, rendering.model(), beams_of(study_),
                               rendering.options());
    ball_->region = std::move(region);
  });
  return *ball_;
}

// A region that a person chose may hold anatomy that has moved against the target, or not the target at all; bodies
// then have no answer. The target's own surroundings decide, not those within the region.
void TargetRegistration::doubt_contradicted_region(std::span<const FixedImage> images,
                                                   RegistrationResult& found) const {
  const Eigen::Vector3d target_room_mm = target_found_room_mm(options_, found);
  std::vector<Stage> stages = options_.stages;
  stages.back().similarity = SimilarityKind::kGradientCorrelation;  // a part of the CT is rendered
  const auto wanted_room_mm =
      place_wanted_near_target(own_ball().renderers ? *own_ball().renderers : setup_.renderers(),
                               {.images = {images.begin(), images.end()}, .region = own_ball().region.projected},
                               found.actual_room_from_patient, target_room_mm, {.stages = stages, .dof = options_.dof});
  if (!wanted_room_mm) {
    found.findings.push_back(
        {.check = Check::kRegionNotConfirmed, .measures = {{.value = kAboutTargetMm, .unit = "mm"}}});
    return;
  }
  const double elsewhere_mm = (*wanted_room_mm - target_room_mm).norm();
  if (elsewhere_mm > limits::kMostFromRegionMm)
    found.findings.push_back({.check = Check::kRegionContradicted,
                              .measures = {{.value = elsewhere_mm, .limit = limits::kMostFromRegionMm, .unit = "mm"},
                                           {.value = kAboutTargetMm, .unit = "mm"}}});
}

RegistrationResult TargetRegistration::from(const Eigen::Isometry3d& start_room_from_patient,
                                            std::span<const FixedImage> images, Observer& observer,
                                            std::optional<std::uint64_t> seed) const {
  RegistrationOptions options = options_;
  options.seed = seed.value_or(options.seed);
  RegistrationResult found = register_views(setup_.renderers(), images, start_room_from_patient, options,
                                            [&](double share) { observer.progress("Registering", share); });
  observer.progress("Registering", 1.0);
  if (setup_.renderers().finest().kind() == RendererKind::kRaycast) {
    std::vector<XrayView> views;
    for (const FixedImage& image : images) views.push_back(image.view);
    const SpotCheck spots = check_rays(setup_.renderers().finest(), setup_.rendered_ct(), request_.rendering.model(),
                                       views, found.actual_room_from_patient);
    found.compared_with_cpu = spots.words();
    if (spots.failure) found.findings.push_back({.check = Check::kGpuDiffers, .words = *spots.failure});
  }
  if (may_have_bent(options, images, found) || may_target_lie_elsewhere(setup_.renderers(), images, options, found))
    register_bodies(bent_patient(), images, study_.planned_room_from_patient, options, found,
                    [&](double share) { observer.progress("Registering the target", share); });
  const bool is_part_chosen = options.region->has_volume() || !options.rectangles.empty();
  if (found.verdict() == Verdict::kAccepted && is_part_chosen) doubt_contradicted_region(images, found);
  const auto add = [&](Check check, std::span<const std::string> doubts) {
    for (const std::string& doubt : doubts) found.findings.push_back({.check = check, .words = doubt});
  };
  add(Check::kRegion, region_doubts_);
  doubt_at_edges_of_rectangles(images, options.rectangles, target_found_room_mm(options, found), found);
  doubt_at_edges_of_fields(images, target_found_room_mm(options, found), found);
  add(Check::kFiles, study_.doubts);
  add(Check::kTarget, choice_.doubts);
  if (surrogate_.doubt) add(Check::kSurrogate, std::span(&*surrogate_.doubt, 1));
  return found;
}

}  // namespace isoshift
