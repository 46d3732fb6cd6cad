#pragma once
// The rigid bodies of a study's CT by number, for people who choose one of them.

#include <string>
#include <vector>

#include "bodies/body_map.h"
#include "io/dicom/ct_series.h"
#include "io/dicom/rt_structures.h"

namespace isoshift {

// Structures that are single bones by their names, such as "L3", "vertebrae_L3", "VB_L3", "Mandible" or "Femur_L".
// Precondition: they are in the CT's frame of reference.
std::vector<DrawnBone> drawn_bones(const RtStructures& structures, const CtSeries& ct);

// The bodies as isoshift inspect --bodies numbers them, from 1. `structures`: null if the study has none.
BodyMap bodies_of(const CtSeries& ct, const RtStructures* structures);

// "body 4: vertebra 1", "body 9: bone".
std::string body_in_words(const BodyMap& map, int number);

// Where a body is: 1 inside, on the lattice of a volume. Throws UsageError for a number that no body has, and for the
// couch.
Volume<std::uint8_t> body_mask(const BodyMap& map, int number, const Volume<float>& lattice);

}  // namespace isoshift
