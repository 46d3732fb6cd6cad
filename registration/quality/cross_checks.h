#pragma once
// Searches again from the pose found, with one view less, or with the patient one vertebra further.

#include <span>
#include <vector>

#include "registration/quality/alternatives.h"
#include "setup/registration.h"

namespace isoshift {

// How far the pose moves without each of the views; empty if fewer than two views would remain. `found` is the result
// of a search with `options`.
std::vector<LeftOutView> leave_out_views(const RendererPyramid& renderers, const FixedViews& views,
                                         const Eigen::Isometry3d& start_room_from_patient, const SearchOptions& options,
                                         const SearchResult& found);

// Vertebrae look alike. Compares the pose found with the best pose that lies about 15 to 45 mm away from it along the
// patient's head-feet axis, in each direction.
std::vector<Alternative> compare_vertebrae(const RendererPyramid& renderers, const FixedViews& views,
                                           const Eigen::Isometry3d& start_room_from_patient,
                                           const SearchOptions& options, const SearchResult& found);

}  // namespace isoshift
