#pragma once
// The answer for the target of a patient who has bent: where the bodies lie that carry it, and what the others did.

#include "registration/bodies/body_search.h"
#include "registration/bodies/patient_bodies.h"
#include "registration/register_views.h"
#include "setup/target.h"

namespace isoshift {

// A patient who may have bent, ready to be searched: made once, for any number of registrations.
struct BentPatient {
  // `structures`: volumes other than the target; how far they lie off is told of those near bones.
  BentPatient(const Volume<float>& ct_hu, const AttenuationModel& attenuation, std::span<const Beam> beams,
              PatientBodies parts, Target target, std::vector<Target> structures);

  PatientBodies parts;
  Target target;
  std::vector<Target> structures;
  RenderedBodies fine, coarse;  // with voxels up to 1.4 and 3 mm
};

// Whether bodies may answer: what was found of the patient as a whole needs a review, or parts near the target do not
// show that they match where the whole puts it; nothing but the whole image was chosen; and all six
// degrees of freedom were searched and checked. What is rejected shows other anatomy: freedom to bend must not let it
// in.
bool may_have_bent(const RegistrationOptions& options, std::span<const FixedImage> images,
                   const RegistrationResult& whole);

// The same of a patient who was accepted as a whole, by what the target's surroundings show: a jaw that has opened far
// matches nowhere near, and no part of the images says where it went.
bool may_target_lie_elsewhere(const RendererPyramid& renderers, std::span<const FixedImage> images,
                              const RegistrationOptions& options, const RegistrationResult& whole);

// Searches all bodies from the pose of the whole, and judges again. In the result, pose, uncertainty, similarities and
// contradictions are those of the bodies that carry the target; `alternatives` gains what the images say of a spine one
// vertebra higher or lower; `bodies` and `structures` hold what the others did. Bones carry the target by their shares
// of it; if soft tissue has most of it, or the CT shows no body, the result stays as it is but for a reason. The
// result's pose must be that of the whole.
void register_bodies(const BentPatient& patient, std::span<const FixedImage> images,
                     const Eigen::Isometry3d& planned_room_from_patient, const RegistrationOptions& options,
                     RegistrationResult& result, const SearchProgress& progress = {});

}  // namespace isoshift
