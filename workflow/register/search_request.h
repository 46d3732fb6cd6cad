#pragma once
// How poses are searched, as the user asks for it, for every command that registers.

#include <optional>
#include <string>

#include "registration/register_views.h"

namespace isoshift {

struct SearchRequest {
  std::string preset = "setup";
  // For the only stage of the preset `paper`.
  std::optional<std::string> similarity, optimizer;
  std::optional<double> pixel_fraction;
  std::string dof = "rigid";
  bool check_vertebrae = false;
  bool is_searched = true;  // false: the start is only judged
  std::uint64_t seed = 1;

  // Throws UsageError for a switch that has no effect on the preset.
  RegistrationOptions registration() const;
  bool is_paper() const { return preset == "paper"; }
};

}  // namespace isoshift
