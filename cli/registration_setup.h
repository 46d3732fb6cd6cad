#pragma once
// From flags and a study to what register_views() takes: the same for every command that registers.

#include <memory>
#include <vector>

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

// The renderers of the last whole CT, for registrations that share it.
class RendererStore {
 public:
  std::shared_ptr<const RendererPyramid> get(const RenderingOptions& rendering,
                                             const std::shared_ptr<const CtSeries>& ct, const std::vector<Beam>& beams);

 private:
  std::shared_ptr<const CtSeries> ct_;
  std::vector<Beam> beams_;
  std::shared_ptr<const RendererPyramid> last_;
};

// The options refer to the region: neither can be moved.
class RegistrationSetup {
 public:
  RegistrationSetup(const RegistrationFlags& flags, const Study& study, const std::vector<Beam>& beams,
                    RendererStore& store);
  RegistrationSetup(const RegistrationSetup&) = delete;
  RegistrationSetup& operator=(const RegistrationSetup&) = delete;

  const RendererPyramid& renderers() const { return *renderers_; }
  const RegistrationOptions& options() const { return options_; }

 private:
  ProjectedRegion region_;
  std::shared_ptr<const RendererPyramid> renderers_;
  RegistrationOptions options_;
};

}  // namespace isoshift
