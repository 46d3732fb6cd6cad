#pragma once
// Searches again from the pose found, with something changed: less views, or one vertebra further.

#include <span>
#include <vector>

#include "registration/quality/alternatives.h"
#include "setup/registration.h"

namespace isoshift {

// One per view; nothing where fewer than two would remain. `found` is what a search with `options` came to.
std::vector<LeftOutView> leave_out_views(const RendererPyramid& renderers, const FixedViews& views,
                                         const Eigen::Isometry3d& start_room_from_patient, const SearchOptions& options,
                                         const SearchResult& found);

// Vertebrae look alike: the best poses some 15 to 45 mm from the one found along the patient's head-feet axis, one per
// direction, beside the pose found.
std::vector<Alternative> compare_vertebrae(const RendererPyramid& renderers, const FixedViews& views,
                                           const Eigen::Isometry3d& start_room_from_patient,
                                           const SearchOptions& options, const SearchResult& found);

}  // namespace isoshift
