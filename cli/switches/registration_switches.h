#pragma once
// The flags of every command that registers: the search, the region, and the rendering.

#include <CLI/CLI.hpp>

#include "workflow/register/registration_setup.h"

namespace isoshift {

void add_registration_switches(CLI::App& command, RegistrationRequest& request);

}  // namespace isoshift
