#pragma once
// Whether what a GPU rendered of a patient is right: some rays of the CT at one pose, computed again on the CPU. The
// self-check (raycast/rendering_check.h) asks whether a device can render; this, whether it did.

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>

#include "drr/renderer.h"

namespace isoshift {

struct SpotCheck {
  std::size_t rays = 0;
  double rms = 0.0;  // difference from the reference, as a share of the root mean square of its line integrals
  std::optional<std::string> failure;  // what is wrong, for people

  std::string words() const;  // "500 rays within 0.2 % (rms)"
};

// Renders about 500 pixels of all views and compares them with exact_line_integrals() of the CT and model from which
// the renderer was made.
SpotCheck check_rays(Renderer& renderer, const Volume<float>& ct_hu, const AttenuationModel& model,
                     std::span<const XrayView> views, const Eigen::Isometry3d& room_from_patient);

}  // namespace isoshift
