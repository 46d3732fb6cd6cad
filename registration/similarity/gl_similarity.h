#pragma once
// Similarities and their models on the GPU (similarity.comp, correlation_sums.comp), as Comparison::of() and model()
// define them: line integrals stay there, a few numbers per pose and view come back.

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

  // The same as models of the patient's motions, from the line integrals' derivatives by them. Of kinds with
  // has_curvature(); of another to ask is a logic error. Result [pose][view], one after the other.
  std::vector<QuadraticModel> models(const Buffer& line_integrals, const Buffer& derivatives, std::size_t poses);

 private:
  // Pixels compared that one work group adds up.
  struct Tile {
    std::uint32_t view, list, first, end;
  };

  void bind_views(const Buffer& line_integrals) const;
  // A work group for each of `per_pose` at every pose.
  void dispatch(std::size_t poses, std::size_t per_pose) const;

  GlContext& context_;
  SimilarityKind kind_;
  const Program& program_;
  Buffer views_, xray_, pairs_, result_;
  std::vector<Tile> tiles_;  // of one pose, by view and list
  Buffer tile_buffer_, middles_, sums_;
  std::size_t view_count_, pixels_per_pose_ = 0;
};

}  // namespace isoshift
