#pragma once
// The flags that choose the region.

#include <CLI/CLI.hpp>

#include "workflow/register/region_options.h"

namespace isoshift {

void add_region_switches(CLI::App& command, RegionOptions& options);

}  // namespace isoshift
