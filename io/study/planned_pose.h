#pragma once
// How the patient of a study was planned to lie.

#include <vector>

#include "io/study/study.h"

namespace isoshift {

// The beam of the plan that an X-ray names; nullptr: it names none of this plan. Throws Error for a number that no beam
// has.
const RtPlan::Beam* planned_beam(const RtPlan& plan, const RtImage& image);

// Patient position, table angles and isocenter of a study, and the pose that follows. `beams`: those of the plan that
// were imaged. Throws Error where they are unknown or contradict each other; what is in doubt stands in the study.
void place_patient(const StudyRequest& request, const std::vector<RtPlan::Beam>& beams, Study& study, Notes& notes);

}  // namespace isoshift
