#pragma once
// Whether the images would match as well, or better, if they were not what they say they are: mirrored, turned by 180
// degrees, or with the labels of two views exchanged (docs/algorithms.md, "Handedness").

#include <span>
#include <string>
#include <vector>

#include "registration/search.h"

namespace isoshift {

struct Alternative {
  std::string description;   // "view 1 mirrored"
  double similarity = 0.0;   // gradient correlation that the search reaches with it,
  double as_is = 0.0;        // and in the same way with the images as they are
  double distance_mm = 0.0;  // between the poses found: translation at the isocenter,
  double angle_rad = 0.0;    // and rotation
};

// Searches with short stages, each time from the start; where an alternative comes close, more closely, at last with
// the last of `options.stages`, and for the images as they are from the pose that registration found.
std::vector<Alternative> compare_alternatives(const RendererPyramid& renderers, const FixedViews& views,
                                              const Eigen::Isometry3d& start_room_from_patient,
                                              const SearchOptions& options, const SearchResult& found);

}  // namespace isoshift
