#pragma once
// Whether a GPU computes similarities as the CPU does (the other half of the self-check:
// drr/raycast/rendering_check.h).

#include <optional>
#include <string>

#include "drr/gl/context.h"

namespace isoshift {

struct SimilarityCheck {
  double largest = 0.0;                // difference from the CPU, of all similarities
  double models = 0.0;                 // the same of their models' gradients and curvatures, as a share of these
  std::optional<std::string> failure;  // what is wrong, for people
};

// Compares two made-up views at two poses by every similarity and, where there is one on the GPU, by its model.
SimilarityCheck check_similarities(GlContext& context);

}  // namespace isoshift
