#pragma once
// Manual pages, made from the text of --help.

#include <CLI/CLI.hpp>
#include <filesystem>

namespace isoshift {

// Writes isoshift.1 and isoshift-COMMAND.1 for every command into a folder, and replaces earlier files.
void write_man_pages(const CLI::App& app, const std::filesystem::path& folder);

}  // namespace isoshift
