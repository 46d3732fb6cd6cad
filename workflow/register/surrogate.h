#pragma once
// What X-rays show of a target: bone. The answer for a target is that of bones near it, or of those that a site names.

#include <cstdint>
#include <optional>
#include <string>

#include "geometry/volume.h"
#include "io/study/study.h"
#include "setup/target.h"
#include "workflow/register/body_store.h"

namespace isoshift {

struct Surrogate {
  std::string words;                          // "bone within 20 mm", "bones in Pelvis (the site file)"
  std::optional<Volume<std::uint8_t>> drawn;  // the structure that a site names, in the CT's voxels
  std::optional<std::string> doubt;           // why a person must look
};

// `by_site`: the structure whose bones carry the target, which the site file names for the anatomy; empty: bones within
// 20 mm of the target's center or surface. In a trunk ribs, shoulder blades and collar bones are a doubt if little
// else lies there: they move with the breath and the arms, and X-rays show little of them. Throws Error if the
// structure is not there or has no closed contour.
Surrogate surrogate_of(const Study& study, const Target& target, const std::string& by_site, BodyStore& bodies);

}  // namespace isoshift
