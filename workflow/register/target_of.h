#pragma once
// Which volume of a study is its target, and which bones carry it.

#include <string>
#include <vector>

#include "io/study/study.h"
#include "registration/target/surrogate.h"
#include "setup/target.h"

namespace isoshift {

// Who names the target; both may be empty.
struct TargetWish {
  std::string by_person;  // --target: the name of a structure, or "isocenter"
  std::string by_site;    // the site file's, for the anatomy: the same
};

struct TargetChoice {
  Target target;
  std::vector<std::string> doubts;  // why a person must confirm the choice
};

// The structure that a person or else the site names; else the one to which the plan's dose references of type TARGET
// refer; else the PTV, or else CTV or GTV, that holds the isocenter; else the isocenter's surroundings. If several fit,
// the smallest that holds the isocenter is taken, and the choice is a doubt. It is also a doubt if target
// volumes are drawn and none holds the isocenter, if the plan refers to what is not there, or if the target reaches
// beyond the CT. Throws Error if a structure that is named
// is not there or has no closed contour in the CT.
TargetChoice target_of(const Study& study, const TargetWish& wish);

// Targets and organs that are drawn in the CT, but for the one of this name; not those that cannot be filled.
std::vector<Target> structures_beside(const std::string& target, const Study& study);

PlannedPatient planned_patient(const Study& study);

// Which bones carry the target. `by_site`: the structure that the site file names for the anatomy; empty: what lies
// near the target. Throws Error if the structure is not there or has no closed contour, or no bone.
Surrogate surrogate_of(const Study& study, const Target& target, const std::string& by_site, BodyStore& bodies);

}  // namespace isoshift
