#pragma once
// The region, as the user asks for it.

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/volume.h"
#include "io/study/study.h"
#include "registration/preprocess/preprocess.h"
#include "registration/region.h"

namespace isoshift {

struct RegionOptions {
  std::vector<std::string> structures, excluded, rectangles;
  std::vector<int> bodies;  // numbers (study_bodies.h)
  std::optional<double> around_isocenter_mm;
  double margin_mm = 5.0;

  // The rectangles by label. Throws UsageError for a rectangle that cannot be parsed, whose label no X-ray has, or that
  // reaches beyond the X-ray.
  RectanglesByLabel rectangles_of(const Study& study) const;

  // The region in words; empty if everything is compared.
  std::vector<std::string> in_words() const;
};

// A volume of the CT that a person or a file chose, as drawn: 1 inside, on the CT's lattice.
struct ChosenVolume {
  std::string words;  // "structure Spine"
  Volume<std::uint8_t> mask;
  bool is_drawn = false;     // by contours, which may lie anywhere; bodies and spheres lie where they must
  bool is_excluded = false;  // and not what is compared
};

// The CT as it is rendered, and the region projected into the views.
struct RegionOfStudy {
  std::vector<ChosenVolume> chosen;

  // The CT inside the volume of interest, without excluded structures; unset: the whole CT.
  std::optional<Volume<float>> rendered_ct;
  ProjectedRegion projected;
};
// Throws UsageError for a radius that is not positive or holds the whole CT and for a body that there is not, and Error
// for a structure the study lacks.
RegionOfStudy region_of(const RegionOptions& options, const Study& study, double threshold_hu);

// The surroundings of a place are compared, whatever was chosen; what was excluded stays excluded. What was chosen is
// rendered, too: it does not end at the ball.
RegionOfStudy ball_about(const Eigen::Vector3d& center_patient_mm, double radius_mm,
                         std::span<const ChosenVolume> chosen, const RegionOptions& options, const Study& study,
                         double threshold_hu);

}  // namespace isoshift
