#include "registration/bodies/moving_bodies.h"

#include <algorithm>

#include "geometry/rotation.h"
#include "registration/preprocess/preprocess.h"

namespace isoshift {
namespace {

constexpr double kHardly = 0.1;  // of a pixel's edge at the isocenter

// exp(motion) is the motion from one pose to the other, a small one.
MotionDerivatives motion_between(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
  const Eigen::Isometry3d motion = to * from.inverse();
  MotionDerivatives result;
  result << motion.translation().cast<float>(), rotation_vector(motion.linear()).cast<float>();
  return result;
}

}  // namespace

MovingBodies::MovingBodies(const BodyRenderers& renderers, const XrayView& view, std::span<const std::uint32_t> pixels)
    : renderers_(renderers),
      view_(view),
      pixels_(pixels),
      hardly_mm_(kHardly / pixels_per_mm(view)),
      bodies_(renderers.count()),
      line_integrals_(pixels.size()) {}

void MovingBodies::render(std::size_t body, const Eigen::Isometry3d& room_from_patient) {
  Body& of = bodies_[body];
  of.drr = renderers_.part_with_derivatives(body, view_, room_from_patient, pixels_);
  of.rendered_at = room_from_patient;
  of.entry_of.assign(pixels_.size(), 0);
  for (std::uint32_t n = 0; n < of.drr.places.size(); ++n) of.entry_of[of.drr.places[n]] = n + 1;
}

void MovingBodies::add(const Body& body, const Eigen::Isometry3d& room_from_patient) {
  const MotionDerivatives motion = motion_between(*body.rendered_at, room_from_patient);
  for (std::size_t n = 0; n < body.drr.places.size(); ++n)
    line_integrals_[body.drr.places[n]] += body.drr.line_integrals[n] + body.drr.derivatives[n].dot(motion);
}

void MovingBodies::move_to(std::span<const Eigen::Isometry3d> room_from_patient) {
  std::ranges::fill(line_integrals_, 0.0F);
  for (std::size_t body = 0; body < bodies_.size(); ++body) {
    const Eigen::Isometry3d& pose = room_from_patient[body];
    const std::optional<Eigen::Isometry3d>& at = bodies_[body].rendered_at;
    if (!at || renderers_.distance_mm(body, *at, pose) > hardly_mm_) render(body, pose);
    add(bodies_[body], pose);
  }
}

}  // namespace isoshift
