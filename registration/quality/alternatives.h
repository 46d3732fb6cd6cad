#pragma once
// Whether the images would match as well, or better, if they were not what they say they are: mirrored, turned by 180
// degrees, or with the labels of two views exchanged (docs/algorithms.md, "Handedness").

#include <span>
#include <string>
#include <vector>

#include "registration/search.h"

namespace isoshift {

struct Alternative {
  std::string description;  // "view 1 mirrored"
  double similarity = 0.0;  // what the search reaches with it
};

struct AlternativesReport {
  double similarity = 0.0;  // of the images as they are, found in the same way
  std::vector<Alternative> alternatives;
};

// Searches with short stages, each time from the start.
AlternativesReport compare_alternatives(const RendererPyramid& renderers, std::span<const FixedImage> images,
                                        const Eigen::Isometry3d& start_room_from_patient, const SearchOptions& options);

}  // namespace isoshift
