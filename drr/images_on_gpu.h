#pragma once
// DRRs that stay where they were rendered, for what can work on them there: the similarities of a search need one
// number per image from the GPU, not the image.

#include <Eigen/Geometry>
#include <cstddef>
#include <span>

#include "drr/gl/context.h"
#include "drr/gl/objects.h"
#include "drr/renderer.h"

namespace isoshift {

class ImagesOnGpu {
 public:
  virtual ~ImagesOnGpu() = default;

  // Line integrals as floats, [pose][view][pixel]. The renderer keeps the buffer, until its next call or its end.
  // Throws Error where the images exceed one storage buffer.
  virtual Buffer& render_on_gpu(std::span<const XrayView> views, std::span<const Eigen::Isometry3d> room_from_patient,
                                const PixelSet& pixels) = 0;

  // The same, and the derivatives of every line integral, MotionDerivatives in the same order.
  struct WithDerivatives {
    Buffer &line_integrals, &derivatives;
  };
  virtual WithDerivatives render_with_derivatives_on_gpu(std::span<const XrayView> views,
                                                         std::span<const Eigen::Isometry3d> room_from_patient,
                                                         const PixelSet& pixels) = 0;

  // How many poses that is. Throws Error where not even one fits.
  virtual std::size_t poses_at_once(std::size_t pixels_per_pose, bool with_derivatives) const = 0;

  // Fills the buffers of so many line integrals and of their derivatives with NaN: what the next images leave out then
  // shows.
  virtual void poison(std::size_t line_integrals) = 0;

  // Where the line integrals are.
  virtual GlContext& context() const = 0;
};

}  // namespace isoshift
