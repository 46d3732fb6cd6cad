#pragma once
// Finds where a patient's bodies put the target, from several places along the spine: what breathes can pull the whole
// patient a vertebra and more off, and vertebrae look alike.

#include <vector>

#include "registration/bodies/body_search.h"
#include "registration/bodies/carriers.h"

namespace isoshift {

struct TargetSearchResult {
  BodyPoses poses;
  std::vector<StageReport> stages;        // of the search that was best
  std::vector<Alternative> alternatives;  // the others, where they were given up or at the end
};

// Searches from the pose of the whole, and, where the CT shows vertebrae, as freely from poses half a
// vertebra and a whole one farther toward head and feet. After every stage, searches are given up that are clearly less
// probable than the best, or that have come to where a better one is.
TargetSearchResult search_target(const BodyScene& scene, const Carriers& carriers, const BodySearchOptions& options,
                                 const SearchProgress& progress);

}  // namespace isoshift
