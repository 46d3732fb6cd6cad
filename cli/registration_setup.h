#pragma once
// From flags and a study to what register_views() takes: the same for every command that registers.

#include "cli/region_switches.h"
#include "cli/rendering_options.h"
#include "cli/search_switches.h"
#include "cli/study_options.h"
#include "drr/renderer_pyramid.h"

namespace isoshift {

struct RegistrationFlags {
  SearchSwitches search;
  RegionSwitches region;
  RenderingOptions rendering;

  // Settles what the preset says of rendering. Throws UsageError for flags that make no sense, before anything is read.
  void settle();
};
void add_registration_flags(CLI::App& command, RegistrationFlags& flags);

// The options refer to the region: neither can be moved.
class RegistrationSetup {
 public:
  RegistrationSetup(const RegistrationFlags& flags, const Study& study)
      : RegistrationSetup(flags, study, beams_of(study)) {}
  // For views of other beam qualities than the study's, too.
  RegistrationSetup(const RegistrationFlags& flags, const Study& study, std::span<const Beam> beams);
  RegistrationSetup(const RegistrationSetup&) = delete;
  RegistrationSetup& operator=(const RegistrationSetup&) = delete;

  const RendererPyramid& renderers() const { return renderers_; }
  const RegistrationOptions& options() const { return options_; }

 private:
  RegionOfStudy region_;
  RendererPyramid renderers_;
  RegistrationOptions options_;
};

}  // namespace isoshift
