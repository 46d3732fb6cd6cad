#pragma once
// What of a CT is compared, where a person or a file has chosen volumes of it.

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/volume.h"
#include "registration/region.h"

namespace isoshift {

// A volume of the CT that was chosen, as drawn: 1 inside, on the CT's lattice.
struct ChosenVolume {
  std::string words;  // "structure Spine"
  Volume<std::uint8_t> mask;
  bool is_drawn = false;      // by contours, which may lie anywhere; bodies and spheres lie where they must
  bool is_excluded = false;   // and not what is compared
  bool keeps_pixels = false;  // excluded, such as a couch: it lies behind everything, and only its voxels go
};

// The CT as it is rendered, and the region projected into the views.
struct ChosenRegion {
  // The CT inside the volume of interest, without excluded volumes; unset: the whole CT.
  std::optional<Volume<float>> rendered_ct;
  ProjectedRegion projected;
};

// `compared`: what is compared; unset: everything. `rendered`: what of the CT is rendered, and a little around it;
// unset: all. What is excluded of `chosen` grows by the margin.
ChosenRegion region_within(std::optional<Volume<std::uint8_t>> compared,
                           const std::optional<Volume<std::uint8_t>>& rendered, std::span<const ChosenVolume> chosen,
                           double margin_mm, const Volume<float>& ct_hu, double threshold_hu);

// The surroundings of a place are compared, whatever was chosen; what was excluded stays excluded. What was chosen is
// rendered, too: it does not end at the ball.
ChosenRegion ball_about(const Eigen::Vector3d& center_patient_mm, double radius_mm,
                        std::span<const ChosenVolume> chosen, double margin_mm, const Volume<float>& ct_hu,
                        double threshold_hu);

// Masks on the lattice of a CT: a sphere, and what is in either of two.
Volume<std::uint8_t> sphere_in(const Volume<float>& ct_hu, const Eigen::Vector3d& center_patient_mm, double radius_mm);
void unite(Volume<std::uint8_t>& mask, const Volume<std::uint8_t>& other);

}  // namespace isoshift
