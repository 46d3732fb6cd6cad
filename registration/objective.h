#pragma once
// How well DRRs at some poses match the X-rays: one number per pose, poses in batches.

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "drr/renderer.h"
#include "registration/preprocess/preprocess.h"

namespace isoshift {

class Objective {
 public:
  // Compares inside each image's field, on a random `pixel_fraction` of it that `seed` draws once. Borrows the renderer.
  // Throws Error for a field of fewer than 100 pixels.
  Objective(Renderer& renderer, std::span<const FixedImage> images, double pixel_fraction, std::uint64_t seed);

  // Similarity per view, in [-1, 1]: normalized cross correlation. Result [pose][view].
  std::vector<std::vector<double>> per_view(std::span<const Eigen::Isometry3d> room_from_patient);

  // The mean over the views, one per pose.
  std::vector<double> values(std::span<const Eigen::Isometry3d> room_from_patient);

 private:
  Renderer& renderer_;
  std::vector<XrayView> views_;
  PixelSet pixels_;
  std::vector<std::vector<float>> fixed_;  // line integrals of the X-ray at the pixels of the set
};

}  // namespace isoshift
