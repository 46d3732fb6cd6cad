#include "workflow/register/target_registration.h"

#include <fmt/format.h>

#include "base/error.h"
#include "drr/spot_check.h"
#include "registration/quality/judge.h"
#include "setup/irradiated_field.h"

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

RegistrationResult TargetRegistration::from(const Eigen::Isometry3d& start_room_from_patient,
                                            std::span<const FixedImage> images, Observer& observer) const {
  RegistrationResult found = register_views(setup_.renderers(), images, start_room_from_patient, options_,
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
  if (may_have_bent(options_, images, found) || may_target_lie_elsewhere(setup_.renderers(), images, options_, found))
    register_bodies(bent_patient(), images, study_.planned_room_from_patient, options_, found,
                    [&](double share) { observer.progress("Registering the target", share); });
  doubt_at_edges_of_fields(images, target_found_room_mm(options_, found), found);
  for (const std::string& doubt : study_.doubts) found.demote(Verdict::kReview, doubt);
  for (const std::string& doubt : choice_.doubts) found.demote(Verdict::kReview, doubt);
  if (surrogate_.doubt) found.demote(Verdict::kReview, *surrogate_.doubt);
  return found;
}

}  // namespace isoshift
