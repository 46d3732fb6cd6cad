#pragma once
// What isoshift register shares with the other commands that write results.

#include <CLI/CLI.hpp>

#include "workflow/register/register_study.h"

namespace isoshift {

// The flags beside those of the study and of registration that decide what is written.
void add_result_options(CLI::App& command, RegisterOptions& options);

// The exit status that a verdict asks for.
int exit_status_of(Verdict verdict);

}  // namespace isoshift
