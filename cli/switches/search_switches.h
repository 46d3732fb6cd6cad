#pragma once
// The flags that say how poses are searched: the same for every command that registers.

#include <CLI/CLI.hpp>

#include "workflow/register/search_request.h"

namespace isoshift {

void add_search_switches(CLI::App& command, SearchRequest& options);

}  // namespace isoshift
