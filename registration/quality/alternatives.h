#pragma once
// Whether the images would match as well, or better, if they were not what they say they are: mirrored, turned by 180
// degrees, or with the labels of two views exchanged (docs/algorithms.md, "Handedness").

#include <span>
#include <string>
#include <vector>

#include "registration/search.h"
#include "setup/registration.h"

namespace isoshift {

// Searches for the pose of every alternative, with short stages and from the start. If an alternative matches nearly as
// well as the images as they are, both are searched for more closely, at last with the last of `options.stages`. The
// closer search of the images as they are begins at the pose that registration found.
std::vector<Alternative> compare_alternatives(const RendererPyramid& renderers, const FixedViews& views,
                                              const Eigen::Isometry3d& start_room_from_patient,
                                              const SearchOptions& options, const SearchResult& found);

}  // namespace isoshift
