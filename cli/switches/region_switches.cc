#include "cli/switches/region_switches.h"

namespace isoshift {

void add_region_switches(CLI::App& command, RegionOptions& options) {
  const char* group = "Region of interest";
  command
      .add_option("--structure", options.structures,
                  "Register only this structure of the RT Structure Set; may be repeated")
      ->type_name("NAME")
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--body", options.bodies,
                  "Register only this bone, by its number in isoshift inspect --bodies; may be repeated")
      ->type_name("NUMBER")
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--around-isocenter", options.around_isocenter_mm,
                  "Register only what lies within this distance of the isocenter")
      ->type_name("MM")
      ->group(group);
  command
      .add_option("--exclude", options.excluded,
                  "Exclude a structure that moves on its own, such as the mandible, or the couch")
      ->type_name("NAME")
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--rectangle", options.rectangles,
                  "Compare only this rectangle, in pixels, of the X-ray with this label")
      ->type_name("LABEL=C0,R0,C1,R1")
      ->allow_extra_args(false)
      ->group(group);
  command.add_option("--margin", options.margin_mm, "Margin around every structure, mm")
      ->type_name("MM")
      ->check(CLI::Range(0.0, 100.0))
      ->capture_default_str()
      ->group(group);
}

}  // namespace isoshift
