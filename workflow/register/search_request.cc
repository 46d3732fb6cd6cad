#include "workflow/register/search_request.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/option_name.h"
#include "registration/presets.h"

namespace isoshift {

RegistrationOptions SearchRequest::registration() const {
  RegistrationOptions options = isoshift::preset(preset);
  if ((similarity || optimizer || pixel_fraction) && !is_paper())
    throw UsageError(fmt::format("{}, {} and {} work only with {}, for its one stage", option("similarity"),
                                 option("optimizer"), option("pixel-fraction"), option("preset", "paper")));
  if (check_vertebrae && is_paper())
    throw UsageError(fmt::format("{} needs a preset that ends with gradient correlation, and {} does not",
                                 option("check-vertebrae"), option("preset", "paper")));
  if (check_vertebrae && !is_searched)
    throw UsageError(fmt::format("{} compares poses that were searched, and {} leaves the search out",
                                 option("check-vertebrae"), option("no-search")));
  Stage& stage = options.stages.front();
  if (similarity) stage.similarity = similarity_kind_from(*similarity).value();
  if (optimizer) stage.optimizer = optimizer_kind_from(*optimizer).value();
  if (optimizer && stage.optimizer == OptimizerKind::kLevenbergMarquardt && !has_curvature(stage.similarity))
    throw UsageError(fmt::format("{} needs a similarity with a curvature, and {} has none",
                                 option("optimizer", *optimizer), to_string(stage.similarity)));
  if (pixel_fraction) stage.pixel_fraction = *pixel_fraction;
  if (pixel_mm) stage.pixel_mm = *pixel_mm;
  if (relative_tolerance) stage.relative_tolerance = *relative_tolerance;
  if (searches > 1) options.stages.resize(static_cast<std::size_t>(searches), Stage(stage));
  if (dof != "rigid" && dof != "translation")
    throw UsageError(fmt::format("{}: expected rigid or translation", option("dof", dof)));
  options.dof = dof == "rigid" ? Dof::kRigid : Dof::kTranslation;
  options.check_vertebrae = check_vertebrae;
  options.is_searched = is_searched;
  options.seed = seed;
  return options;
}

}  // namespace isoshift
