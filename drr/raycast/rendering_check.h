#pragma once
// Whether a ray caster computes what the oracle does: a GPU and its driver are trusted with a patient only after they
// have rendered volumes whose DRRs are known.

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "drr/renderer.h"

namespace isoshift {

struct RenderingCheck {
  // Differences from `trilinear` as shares of the largest line integral of their image: root mean square, and the
  // largest; of the worst image.
  double rms = 0.0, largest = 0.0;
  double largest_of_waves = 0.0;       // the largest difference in the volume of waves alone
  double slopes = 0.0;                 // differences of derivatives as a share of these, rms; of the worst
  double samples_per_second = 0.0;     // taken along rays of the densest image, with the way to the device and back
  std::optional<std::string> failure;  // what is wrong, for people
};

// The ray caster that is checked, of a CT.
using MakeRayCaster = std::function<std::unique_ptr<Renderer>(const Volume<float>& ct_hu, const AttenuationModel& model,
                                                              std::span<const Beam> beams)>;

// Renders a cube of water and a volume of waves at kV and MV, from oblique directions at several poses, whole images
// and single pixels, in one call and in several, and compares with `trilinear`; of the waves also the derivatives of
// single pixels. Every pixel must have been written.
RenderingCheck check_rendering(const MakeRayCaster& make);

// How many rays a dispatch should have at most on such a device: a quarter of a second of long rays through a clinical
// CT, but no more than 2^24 rays.
std::size_t rays_per_dispatch(double samples_per_second);

}  // namespace isoshift
