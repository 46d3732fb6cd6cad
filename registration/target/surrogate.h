#pragma once
// What X-rays show of a target: bone. The answer for a target is that of bones near it, or of those that a site names.

#include <cstdint>
#include <optional>
#include <string>

#include "geometry/volume.h"
#include "registration/target/body_store.h"
#include "registration/target/chosen_region.h"
#include "registration/target/planned_patient.h"
#include "setup/target.h"

namespace isoshift {

struct Surrogate {
  std::string words;                          // "bone within 20 mm", "bones in Pelvis (the site file)"
  std::optional<Volume<std::uint8_t>> drawn;  // the structure that a site names, in the CT's voxels
  std::optional<std::string> doubt;           // why a person must look
};

// Bones within 20 mm of the target's center or surface. In a trunk ribs, shoulder blades and collar bones are a doubt
// if little else lies there: they move with the breath and the arms, and X-rays show little of them.
Surrogate surrogate_near(const PlannedPatient& patient, const Target& target, BodyStore& bodies);

// Bones in a structure that somebody names. Throws Error if the CT shows no bone in it.
Surrogate surrogate_in(const PlannedPatient& patient, const Target& target, ChosenVolume drawn);

}  // namespace isoshift
