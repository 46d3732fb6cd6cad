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

std::shared_ptr<const RendererPyramid> RendererStore::get(const RenderingOptions& rendering,
                                                          const std::shared_ptr<const CtSeries>& ct,
                                                          const std::vector<Beam>& beams) {
  if (!last_ || ct != ct_ || beams != beams_) {
    last_.reset();  // never two in memory
    last_ = std::make_shared<const RendererPyramid>(rendering.kind(), ct->hu, rendering.model(), beams,
                                                    rendering.options());
    ct_ = ct;
    beams_ = beams;
  }
  return last_;
}

RegistrationSetup::RegistrationSetup(const RegistrationFlags& flags, const Study& study, const std::vector<Beam>& beams,
                                     RendererStore& store)
    : options_(flags.search.registration()) {
  RegionOfStudy region = region_of(flags.region, study, flags.rendering.threshold_hu);
  if (region.rendered_ct)
    renderers_ = std::make_shared<const RendererPyramid>(flags.rendering.kind(), *region.rendered_ct,
                                                         flags.rendering.model(), beams, flags.rendering.options());
  else
    renderers_ = store.get(flags.rendering, study.ct, beams);
  region_ = std::move(region.projected);
  options_.region = &region_;
  options_.rectangles = flags.region.rectangles_of(study);
}

}  // namespace isoshift
