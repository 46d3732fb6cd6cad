#pragma once
// Whether what a person or a file chose to be compared holds what it is chosen for. Contours that a program wrote
// flipped, turned or on another scale name the target's bone, and hold something else.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/volume.h"
#include "registration/target/chosen_region.h"
#include "registration/target/planned_patient.h"
#include "setup/target.h"

namespace isoshift {

// Whether a fifth of a mask on the CT's lattice or more lies in the patient, lungs included: loose contours hold much
// air.
bool is_in_body(const Volume<std::uint8_t>& mask, const Volume<float>& ct_hu);

// Why a person must look at the chosen volumes; each doubt names the volume, its share in bone and its distance from
// the isocenter. A drawn volume must lie in the body, and hold bone on a third of its slices; all together, grown by
// the margin, must hold a quarter of the bone within 20 mm of the target. `surrogate`: the structure whose bones carry
// the target, if a site names one: then it is some of their bone that must be held.
std::vector<std::string> region_doubts(const PlannedPatient& patient, std::span<const ChosenVolume> chosen,
                                       double margin_mm, const Target& target,
                                       const std::optional<Volume<std::uint8_t>>& surrogate);

// The same of one volume without a look at the target: nothing if it lies in the body and holds bone.
std::optional<std::string> volume_doubt(const PlannedPatient& patient, const ChosenVolume& volume);

}  // namespace isoshift
