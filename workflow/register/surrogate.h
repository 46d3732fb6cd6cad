#pragma once
// What X-rays show of a target: bone. The answer for a target is that of bones near it, or of those that a site names.

#include <cstdint>
#include <optional>
#include <string>

#include "geometry/volume.h"
#include "io/study/study.h"
#include "setup/target.h"

namespace isoshift {

struct Surrogate {
  std::string words;                          // "bone within 20 mm", "bones in Pelvis (the site file)"
  std::optional<Volume<std::uint8_t>> drawn;  // the structure that a site names, in the CT's voxels
  std::optional<std::string> doubt;           // why a person must look
};

// `by_site`: the structure whose bones carry the target, which the site file names for the anatomy; empty: bones within
// 20 mm of the target's center or surface. Throws Error if the structure is not there or has no closed contour.
Surrogate surrogate_of(const Study& study, const Target& target, const std::string& by_site);

}  // namespace isoshift
