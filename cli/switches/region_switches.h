#pragma once
// The flags that say which part of the patient is registered.

#include <CLI/CLI.hpp>

#include "workflow/register/region_options.h"

namespace isoshift {

void add_region_switches(CLI::App& command, RegionOptions& options);

}  // namespace isoshift
