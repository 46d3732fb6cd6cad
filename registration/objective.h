#pragma once
// How well DRRs at some poses match the X-rays: one number per pose, poses in batches.

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "drr/renderer.h"
#include "registration/preprocess/preprocess.h"
#include "registration/similarity/similarity.h"

namespace isoshift {

struct ObjectiveOptions {
  SimilarityKind similarity = SimilarityKind::kNcc;
  double pixel_fraction = 1.0;  // share of the field's pixels that are compared
  std::uint64_t seed = 1;       // draws them, once
};

class Objective {
 public:
  // Compares inside each image's field. Borrows the renderer. Throws Error for a field of fewer than 100 pixels.
  Objective(Renderer& renderer, std::span<const FixedImage> images, const ObjectiveOptions& options);

  // Similarity per view, in [-1, 1]. Result [pose][view].
  std::vector<std::vector<double>> per_view(std::span<const Eigen::Isometry3d> room_from_patient);

  // Where the time went so far.
  struct Seconds {
    double rendering = 0.0, similarity = 0.0;
  };
  const Seconds& seconds() const { return seconds_; }

  // The mean over the views, one per pose.
  std::vector<double> values(std::span<const Eigen::Isometry3d> room_from_patient);

 private:
  // The X-ray's side of one view's comparison.
  struct Target {
    std::vector<float> line_integral;  // at the pixels rendered
    std::vector<Neighbors> neighbors;  // for gradients: of the pixels compared, among those rendered
    Gradients gradients;
  };

  void add_view(const FixedImage& image, const std::vector<std::uint32_t>& compared);
  double compare(const Target& target, std::span<const float> drr) const;

  Renderer& renderer_;
  SimilarityKind similarity_;
  std::vector<XrayView> views_;
  PixelSet pixels_;
  std::vector<Target> targets_;
  Seconds seconds_;
};

}  // namespace isoshift
