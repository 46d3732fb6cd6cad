#pragma once
// The flags that say how poses are searched: the same for every command that registers.

#include <CLI/CLI.hpp>
#include <string>

#include "registration/register_views.h"

namespace isoshift {

struct SearchOptions {
  std::string dof = "rigid";
  std::uint64_t seed = RegistrationOptions{}.seed;

  RegistrationOptions registration() const;
};
void add_search_options(CLI::App& command, SearchOptions& options);

}  // namespace isoshift
