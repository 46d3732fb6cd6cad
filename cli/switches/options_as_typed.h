#pragma once
// The options of a command line again, for another call of this program.

#include <CLI/CLI.hpp>
#include <set>
#include <string>
#include <vector>

namespace isoshift {

// Every option that was given: "--preset=fast", "--check-vertebrae"; without those of these names.
std::vector<std::string> options_as_typed(const CLI::App& command, const std::set<std::string>& except);

}  // namespace isoshift
