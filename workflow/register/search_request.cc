#include "workflow/register/search_request.h"

#include "base/error.h"
#include "registration/presets.h"

namespace isoshift {

RegistrationOptions SearchRequest::registration() const {
  RegistrationOptions options = isoshift::preset(preset);
  if ((similarity || optimizer || pixel_fraction) && !is_paper())
    throw UsageError("--similarity, --optimizer and --pixel-fraction work only with --preset paper, for its one stage");
  if (check_vertebrae && is_paper())
    throw UsageError(
        "--check-vertebrae needs a preset that ends with gradient correlation, and --preset paper does not");
  if (check_vertebrae && !is_searched)
    throw UsageError("--check-vertebrae compares poses that were searched, and --no-search leaves the search out");
  if (similarity) options.stages.front().similarity = similarity_kind_from(*similarity).value();
  if (optimizer) options.stages.front().optimizer = optimizer_kind_from(*optimizer).value();
  if (pixel_fraction) options.stages.front().pixel_fraction = *pixel_fraction;
  options.dof = dof == "rigid" ? Dof::kRigid : Dof::kTranslation;
  options.check_vertebrae = check_vertebrae;
  options.is_searched = is_searched;
  options.seed = seed;
  return options;
}

}  // namespace isoshift
