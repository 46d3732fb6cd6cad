#include "workflow/register/target_registration.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "drr/spot_check.h"
#include "registration/bodies/target_match.h"
#include "registration/quality/judge.h"
#include "setup/irradiated_field.h"
#include "workflow/register/region_check.h"

namespace isoshift {
namespace {

// A target nearer to the edge of what a view shows is cut off with what could tell where it lies: targets 10 mm inside
// of a field's edge, on jaws that had opened, were accepted 3 mm off. Small fields of the campaign had 15 mm and more.
constexpr double kLeastInsideMm = 12.0;

void doubt_at_edges_of_fields(std::span<const FixedImage> images, const Eigen::Vector3d& target_room_mm,
                              RegistrationResult& found) {
  for (std::size_t view = 0; view < images.size(); ++view) {
    const auto place_px = images[view].view.project(target_room_mm);
    if (!place_px) continue;
    const double inside_mm = inside_px(found.views[view].field, *place_px) / pixels_per_mm(images[view].view);
    if (inside_mm >= kLeastInsideMm) continue;
    const std::string name = name_of_view(images[view].label, view);
    found.demote(Verdict::kReview,
                 inside_mm < 0.0
                     ? fmt::format("{} does not show the target: its center lies outside of the field", name)
                     : fmt::format("{} shows the target {:.0f} mm from the edge of the field: what surrounds "
                                   "it is not seen ({:.0f} mm are expected)",
                                   name, inside_mm, kLeastInsideMm));
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
    if (inside_mm < kLeastInsideMm)
      found.demote(
          Verdict::kReview,
          inside_mm < 0.0
              ? fmt::format("the rectangle of {} does not hold the target: its center lies {:.0f} mm outside",
                            image.label, -inside_mm)
              : fmt::format("the rectangle of {} ends {:.0f} mm from the target's center: what surrounds it is "
                            "not compared ({:.0f} mm are expected)",
                            image.label, inside_mm, kLeastInsideMm));
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
// then have no answer. The target's own surroundings decide, not those within the region. Right answers for regions of
// phantoms and of real CTs were wanted at most 0.4 mm elsewhere by what surrounds the target; answers that a bend had
// put 1.0 and 2.4 mm off, 0.5 and 2.4 mm.
void TargetRegistration::doubt_contradicted_region(std::span<const FixedImage> images,
                                                   RegistrationResult& found) const {
  constexpr double kMostMm = 0.5;
  const Eigen::Vector3d target_room_mm = target_found_room_mm(options_, found);
  std::vector<Stage> stages = options_.stages;
  stages.back().similarity = SimilarityKind::kGradientCorrelation;  // a part of the CT is rendered
  const auto wanted_room_mm =
      place_wanted_near_target(own_ball().renderers ? *own_ball().renderers : setup_.renderers(),
                               {.images = {images.begin(), images.end()}, .region = own_ball().region.projected},
                               found.actual_room_from_patient, target_room_mm, {.stages = stages, .dof = options_.dof});
  if (!wanted_room_mm) {
    found.demote(Verdict::kReview,
                 fmt::format("the X-rays show too little within {:.0f} mm of the target to confirm what "
                             "the chosen region says",
                             kAboutTargetMm));
    return;
  }
  const double elsewhere_mm = (*wanted_room_mm - target_room_mm).norm();
  if (elsewhere_mm > kMostMm)
    found.demote(Verdict::kReview,
                 fmt::format("what the X-rays show within {:.0f} mm of the target puts it {:.1f} mm elsewhere: anatomy "
                             "in the chosen region may have moved against it. A smaller region may tell, or none",
                             kAboutTargetMm, elsewhere_mm));
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
    if (spots.failure) found.demote(Verdict::kReview, *spots.failure);
  }
  if (may_have_bent(options, images, found) || may_target_lie_elsewhere(setup_.renderers(), images, options, found))
    register_bodies(bent_patient(), images, study_.planned_room_from_patient, options, found,
                    [&](double share) { observer.progress("Registering the target", share); });
  const bool is_part_chosen = options.region->has_volume() || !options.rectangles.empty();
  if (found.verdict == Verdict::kAccepted && is_part_chosen) doubt_contradicted_region(images, found);
  for (const std::string& doubt : region_doubts_) found.demote(Verdict::kReview, doubt);
  doubt_at_edges_of_rectangles(images, options.rectangles, target_found_room_mm(options, found), found);
  doubt_at_edges_of_fields(images, target_found_room_mm(options, found), found);
  for (const std::string& doubt : study_.doubts) found.demote(Verdict::kReview, doubt);
  for (const std::string& doubt : choice_.doubts) found.demote(Verdict::kReview, doubt);
  if (surrogate_.doubt) found.demote(Verdict::kReview, *surrogate_.doubt);
  return found;
}

}  // namespace isoshift
