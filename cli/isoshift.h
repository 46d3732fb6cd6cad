#pragma once
// The whole program, for main() and for tests.

#include <filesystem>

#include "cli/console.h"

namespace isoshift {

// Parses the command line, runs the command, and turns every exception into a message and an exit status.
int run_isoshift(int argc, const char* const* argv, Console& console);

// Writes the manual pages of all commands into a folder, and isoshift.bash, which completes them.
void write_manual(const std::filesystem::path& folder);

}  // namespace isoshift
