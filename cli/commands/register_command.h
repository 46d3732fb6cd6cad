#pragma once
// Code that isoshift register shares with the other commands that write results.

#include "cli/console.h"
#include "workflow/register/register_study.h"

namespace CLI {  // NOLINT(readability-identifier-naming): a name of CLI11
class App;
}

namespace isoshift {

// Adds the flags that decide which files are written.
void add_result_options(CLI::App& command, RegisterOptions& options);

// Adds --start.
void add_start_option(CLI::App& command, RegisterOptions& options);

// What flags of isoshift register say that name no parts of a study and no output. Throws UsageError for other flags,
// and for those that contradict each other.
RegisterOptions register_options_from(const std::vector<std::string>& flags);

// Registers, prints the report or result.json, and beside it the truth of a phantom study where a file is named.
// Returns the exit status.
int run_register(RegisterOptions options, bool as_json, Console& console);

// The exit status of a verdict.
int exit_status_of(Verdict verdict);

}  // namespace isoshift
