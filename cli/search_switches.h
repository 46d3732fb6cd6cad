#pragma once
// The flags that say how poses are searched: the same for every command that registers.

#include <CLI/CLI.hpp>
#include <string>

#include "registration/register_views.h"

namespace isoshift {

struct SearchSwitches {
  std::string preset = "setup";
  std::string dof = "rigid";
  std::uint64_t seed = 1;

  RegistrationOptions registration() const;
};
void add_search_switches(CLI::App& command, SearchSwitches& options);

}  // namespace isoshift
