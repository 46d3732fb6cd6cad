#pragma once
// Completion of commands, flags and the values of flags in bash.

#include <CLI/CLI.hpp>
#include <string>

namespace isoshift {

// The script that bash-completion loads for `isoshift`. Names of files complete where nothing else does.
std::string bash_completion(const CLI::App& app);

}  // namespace isoshift
