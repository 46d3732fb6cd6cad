#pragma once
// The flags that say which part of the patient is registered.

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "io/study.h"
#include "registration/region.h"

namespace isoshift {

struct RegionSwitches {
  std::vector<std::string> structures, excluded, rectangles;
  std::optional<double> around_isocenter_mm;
  double margin_mm = 5.0;

  // Whether a part was chosen, rather than all that the views show.
  bool is_chosen() const { return !structures.empty() || around_isocenter_mm.has_value(); }
};
void add_region_switches(CLI::App& command, RegionSwitches& switches);

// A study with what is compared of it: rectangles cut from the fields of the X-rays, and the CT as it is rendered.
struct RegionOfStudy {
  Volume<float> rendered_ct;  // without what lies outside the volume of interest and without excluded structures
  ProjectedRegion projected;
};
// Throws UsageError for switches that contradict each other or the study, and Error for a structure it lacks.
RegionOfStudy region_of(const RegionSwitches& switches, const Study& study, double threshold_hu);

}  // namespace isoshift
