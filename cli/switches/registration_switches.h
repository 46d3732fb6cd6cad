#pragma once
// The flags of every command that registers: how to search, what of the patient, how to render.

#include <CLI/CLI.hpp>

#include "workflow/register/registration_setup.h"

namespace isoshift {

void add_registration_switches(CLI::App& command, RegistrationRequest& request);

}  // namespace isoshift
