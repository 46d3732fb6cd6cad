#pragma once
// Code that isoshift register shares with the other commands that write results.

#include <CLI/CLI.hpp>

#include "workflow/register/register_study.h"

namespace isoshift {

// Adds the flags that decide which files are written.
void add_result_options(CLI::App& command, RegisterOptions& options);

// The exit status of a verdict.
int exit_status_of(Verdict verdict);

}  // namespace isoshift
