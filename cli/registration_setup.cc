#include "cli/registration_setup.h"

namespace isoshift {

void RegistrationFlags::settle() {
  search.registration().check();
  if (search.is_paper()) rendering.default_to_paper();
  rendering.check();
}

void add_registration_flags(CLI::App& command, RegistrationFlags& flags) {
  add_search_switches(command, flags.search);
  add_region_switches(command, flags.region);
  add_rendering_options(command, flags.rendering);
}

RegistrationSetup::RegistrationSetup(const RegistrationFlags& flags, const Study& study, std::span<const Beam> beams)
    : region_(region_of(flags.region, study, flags.rendering.threshold_hu)),
      renderers_(flags.rendering.kind(), region_.rendered_ct, flags.rendering.model(), beams,
                 flags.rendering.options()),
      options_(flags.search.registration()) {
  options_.region = &region_.projected;
  options_.rectangles = flags.region.rectangles_of(study);
}

}  // namespace isoshift
