#pragma once
// How well DRRs at some poses match the X-rays: one number per pose, poses in batches.

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "drr/renderer.h"
#include "registration/preprocess/preprocess.h"
#include "registration/similarity/similarity.h"

namespace isoshift {

struct ObjectiveOptions {
  SimilarityKind similarity = SimilarityKind::kNcc;
  double pixel_fraction = 1.0;  // share of the field's pixels that are compared: drawn, or for gradients the strongest
  std::size_t min_pixels = 1000;  // of every view, if its field has them
  std::uint64_t seed = 1;         // draws them
};

class GlSimilarity;

// The derivatives of a rendered list by the motion of the patient, as they stand.
inline Eigen::Map<const PixelJacobian> pixel_jacobian(std::span<const MotionDerivatives> derivatives) {
  return {derivatives.front().data(), static_cast<Eigen::Index>(derivatives.size()), 6};
}

class Objective {
 public:
  // Compares inside each image's field. Borrows the renderer. Throws Error for a field of fewer than 100 pixels,
  // and UsageError without images, or for a pixel_fraction that is not in (0, 1].
  // `about` is near the poses to come: gradients are compared where they are strong there, and histograms have the
  // range of the DRR there.
  Objective(Renderer& renderer, std::span<const FixedImage> images, const Eigen::Isometry3d& about,
            const ObjectiveOptions& options);
  ~Objective();

  // Similarity per view. Result [pose][view]. If the renderer can leave its line integrals on the GPU, the similarity
  // is computed there.
  std::vector<std::vector<double>> per_view(std::span<const Eigen::Isometry3d> room_from_patient);

  // The same with models: their parameters are the motion of the patient on top of each pose, in the units of
  // MotionDerivatives. Needs a renderer with derivatives.
  std::vector<QuadraticModel> models(std::span<const Eigen::Isometry3d> room_from_patient);

  // What the similarities are computed from.
  RenderResult render(std::span<const Eigen::Isometry3d> room_from_patient) {
    return renderer_.render(views_, room_from_patient, pixels_);
  }
  bool has_derivatives() const { return renderer_.has_derivatives(); }
  RenderResult render_with_derivatives(std::span<const Eigen::Isometry3d> room_from_patient) {
    return renderer_.render_with_derivatives(views_, room_from_patient, pixels_);
  }
  std::span<const XrayView> views() const { return views_; }
  const Comparison& comparison(std::size_t view) const { return comparisons_[view]; }
  // Indices (row * columns + column) of the pixels rendered in a view, to which neighbors refer.
  std::span<const std::uint32_t> rendered_pixels(std::size_t view) const { return pixels_.of_view[view]; }
  // The same of the pixels compared.
  std::span<const std::uint32_t> compared_pixels(std::size_t view) const { return compared_[view]; }

  // Where the time went so far. A GPU measures its rendering by its own clock; all other time counts as similarity.
  struct Seconds {
    double rendering = 0.0, similarity = 0.0;
  };
  const Seconds& seconds() const { return seconds_; }

  // The mean over the views, one per pose.
  std::vector<double> values(std::span<const Eigen::Isometry3d> room_from_patient);

 private:
  // The models of the views, [pose][view] one after the other.
  std::vector<QuadraticModel> models_of_views(std::span<const Eigen::Isometry3d> room_from_patient);
  // What `compare` makes of the images that `render` leaves on the GPU, of as many poses at a time as fit.
  template <class Render, class Compare>
  auto on_gpu(std::span<const Eigen::Isometry3d> room_from_patient, bool with_derivatives, Render render,
              Compare compare);

  Renderer& renderer_;
  SimilarityKind similarity_;
  std::vector<XrayView> views_;
  PixelSet pixels_;
  std::vector<std::vector<std::uint32_t>> compared_;
  std::vector<Comparison> comparisons_;
  std::unique_ptr<GlSimilarity> gl_similarity_;  // where the renderer is on a GPU
  Seconds seconds_;
};

}  // namespace isoshift
