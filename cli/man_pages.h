#pragma once
// Manual pages, from the same text as --help.

#include <CLI/CLI.hpp>
#include <filesystem>

namespace isoshift {

// Writes isoshift.1 and isoshift-COMMAND.1 for every command into a folder, in place of earlier ones.
void write_man_pages(const CLI::App& app, const std::filesystem::path& folder);

}  // namespace isoshift
