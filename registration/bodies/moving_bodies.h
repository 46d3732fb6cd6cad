#pragma once
// The DRR of bodies in one view while a search moves them.

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "drr/bodies.h"
#include "geometry/xray_view.h"

namespace isoshift {

// A body that hardly moved since it was rendered is not rendered again: its line integrals follow their derivatives.
class MovingBodies {
 public:
  // Of the listed pixels (row * columns + column). Borrows all.
  MovingBodies(const BodyRenderers& renderers, const XrayView& view, std::span<const std::uint32_t> pixels);

  // To their poses in this view, one per body.
  void move_to(std::span<const Eigen::Isometry3d> room_from_patient);

  std::size_t count() const { return bodies_.size(); }

  // Of the listed pixels, all bodies together.
  std::span<const float> line_integrals() const { return line_integrals_; }

  bool covers(std::size_t body, std::uint32_t pixel) const { return bodies_[body].entry_of[pixel] != 0; }

  // How much more the line integral of one listed pixel than that of another changes with a body's motion.
  MotionDerivatives derivatives_between(std::size_t body, std::uint32_t from, std::uint32_t to) const {
    const Body& of = bodies_[body];
    return of.drr_derivatives(of.entry_of[to]) - of.drr_derivatives(of.entry_of[from]);
  }

 private:
  struct Body {
    std::optional<Eigen::Isometry3d> rendered_at;
    BodyDrr drr;
    std::vector<std::uint32_t> entry_of;  // of drr, by pixel; counted from 1, 0 where the body is not

    MotionDerivatives drr_derivatives(std::uint32_t entry) const {
      return entry == 0 ? MotionDerivatives(MotionDerivatives::Zero()) : drr.derivatives[entry - 1];
    }
  };

  void render(std::size_t body, const Eigen::Isometry3d& room_from_patient);
  void add(const Body& body, const Eigen::Isometry3d& room_from_patient);

  const BodyRenderers& renderers_;
  const XrayView& view_;
  std::span<const std::uint32_t> pixels_;
  double hardly_mm_;
  std::vector<Body> bodies_;
  std::vector<float> line_integrals_;
};

}  // namespace isoshift
