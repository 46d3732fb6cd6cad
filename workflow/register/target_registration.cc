#include "workflow/register/target_registration.h"

#include <fmt/format.h>

#include "base/error.h"

namespace isoshift {

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
  if (may_have_bent(options_, images, found) || may_target_lie_elsewhere(setup_.renderers(), images, options_, found))
    register_bodies(bent_patient(), images, study_.planned_room_from_patient, options_, found,
                    [&](double share) { observer.progress("Registering the target", share); });
  for (const std::string& doubt : study_.doubts) found.demote(Verdict::kReview, doubt);
  for (const std::string& doubt : choice_.doubts) found.demote(Verdict::kReview, doubt);
  if (surrogate_.doubt) found.demote(Verdict::kReview, *surrogate_.doubt);
  return found;
}

}  // namespace isoshift
