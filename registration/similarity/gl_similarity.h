#pragma once
// Similarities on the GPU (similarity.comp), as Comparison::of() defines them: line integrals stay there, one number
// per pose and view comes back.

#include <cstddef>
#include <span>
#include <vector>

#include "drr/gl/context.h"
#include "drr/gl/objects.h"
#include "registration/similarity/similarity.h"

namespace isoshift {

class GlSimilarity {
 public:
  // Uploads the X-rays' side of all views, which have one kind. Borrows the context of the line integrals to come.
  GlSimilarity(GlContext& context, std::span<const Comparison> comparisons);
  ~GlSimilarity() { context_.try_make_current(); }
  GlSimilarity(const GlSimilarity&) = delete;
  GlSimilarity& operator=(const GlSimilarity&) = delete;

  // Of line integrals as ImagesOnGpu leaves them, [pose][view][pixel], the pixels in the order
  // of the X-rays'. Waits until they are there. Result [pose][view].
  std::vector<std::vector<double>> of(const Buffer& line_integrals, std::size_t poses);

 private:
  const GlContext& context_;
  const Program& program_;
  Buffer views_, xray_, pairs_, result_;
  std::size_t view_count_, pixels_per_pose_ = 0;
};

}  // namespace isoshift
