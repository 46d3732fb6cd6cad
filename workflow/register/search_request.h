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
  // The same, for Table 2 of the founding paper; they have no flags.
  std::optional<double> pixel_mm, relative_tolerance;
  int searches = 1;  // of that stage, one after the other: each begins anew where the one before ended
  std::string dof = "rigid";
  bool check_vertebrae = false;
  bool is_searched = true;  // false: the start is only judged
  std::uint64_t seed = 1;

  // Throws UsageError for a switch that has no effect on the preset.
  RegistrationOptions registration() const;
  bool is_paper() const { return preset == "paper"; }
};

}  // namespace isoshift
