#pragma once
// Turns a user's request and a study into the input of register_views(), for every command that registers.

#include <memory>
#include <optional>
#include <vector>

#include "drr/renderer_pyramid.h"
#include "registration/target/target_registration.h"
#include "workflow/register/region_options.h"
#include "workflow/register/rendering_options.h"
#include "workflow/register/search_request.h"
#include "workflow/register/study_options.h"
#include "workflow/register/target_of.h"

namespace isoshift {

struct RegistrationRequest {
  SearchRequest search;
  RegionOptions region;
  RenderingOptions rendering;

  // Applies the rendering options that the preset implies. Throws UsageError for options that contradict each other,
  // before any file is read.
  void settle();
};

// Keeps the renderers of the last whole CT, for registrations that share it.
class RendererStore {
 public:
  std::shared_ptr<const RendererPyramid> get(const RenderingOptions& rendering,
                                             const std::shared_ptr<const CtSeries>& ct, const std::vector<Beam>& beams);

 private:
  std::shared_ptr<const CtSeries> ct_;
  std::vector<Beam> beams_;
  std::shared_ptr<const RendererPyramid> last_;
};

class RegistrationSetup {
 public:
  RegistrationSetup(const RegistrationRequest& request, const Study& study, const std::vector<Beam>& beams,
                    RendererStore& store);

  const RendererPyramid& renderers() const { return *renderers_; }
  const Volume<float>& rendered_ct() const { return region_ct_ ? *region_ct_ : ct_->hu; }
  const RegistrationOptions& options() const { return options_; }
  const std::vector<ChosenVolume>& chosen() const { return chosen_; }  // what a person or a file chose of the CT

 private:
  std::vector<ChosenVolume> chosen_;
  std::shared_ptr<const CtSeries> ct_;
  std::optional<Volume<float>> region_ct_;  // where a volume of interest is rendered and not the whole CT
  std::shared_ptr<const RendererPyramid> renderers_;
  RegistrationOptions options_;
};

// What is registered of a study for its target. Borrows the study, until the problem is solved.
TargetProblem target_problem(const Study& study, const RegistrationRequest& request, const RegistrationSetup& setup,
                             const TargetChoice& choice, const Surrogate& surrogate);

}  // namespace isoshift
