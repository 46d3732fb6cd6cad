#pragma once
// The outline that leaves make, looked for in an X-ray near where a file says that it is.

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "registration/preprocess/field_edges.h"

namespace isoshift {

// How the declared outline has to be moved, so that the image darkens across as much of it as possible: pixels of the
// upright image, at most 3 mm along each axis. Nothing if the image darkens across less than three quarters of what
// lies on the receptor.
std::optional<Eigen::Vector2d> shift_to_seen_outline(const UprightXray& xray,
                                                     const std::vector<Eigen::Vector2d>& outline_px);

}  // namespace isoshift
