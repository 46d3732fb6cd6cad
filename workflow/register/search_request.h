#pragma once
// How poses are searched, as a person asks for it: the same for every command that registers.

#include <optional>
#include <string>

#include "registration/register_views.h"

namespace isoshift {

struct SearchRequest {
  std::string preset = "setup";
  // Of the single stage of preset `paper`.
  std::optional<std::string> similarity, optimizer;
  std::optional<double> pixel_fraction;
  std::string dof = "rigid";
  bool check_vertebrae = false;
  std::uint64_t seed = 1;

  // Throws UsageError for a switch that means nothing to the preset.
  RegistrationOptions registration() const;
  bool is_paper() const { return preset == "paper"; }
};

}  // namespace isoshift
