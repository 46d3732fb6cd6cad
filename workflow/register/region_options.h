#pragma once
// The region, as the user asks for it.

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "io/study/study.h"
#include "registration/preprocess/preprocess.h"
#include "registration/target/chosen_region.h"

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

struct RegionOfStudy {
  std::vector<ChosenVolume> chosen;
  ChosenRegion region;
};
// Throws UsageError for a radius that is not positive or holds the whole CT and for a body that there is not, and Error
// for a structure the study lacks.
RegionOfStudy region_of(const RegionOptions& options, const Study& study, double threshold_hu);

}  // namespace isoshift
