#pragma once
// The flags of every command that reads a study: they name its parts, supply values that its files lack, and allow
// failed checks.

#include <CLI/CLI.hpp>

#include "workflow/register/study_options.h"

namespace isoshift {

CLI::Option* add_allow_option(CLI::App& command, std::vector<std::string>& allow);
void add_study_options(CLI::App& command, StudyOptions& options);
// Of Spatial Registration objects of other programs.
CLI::Option* add_source_isocenter_option(CLI::App& command, std::vector<double>& source_isocenter);
// The flags that do not name the parts of a study.
void add_study_switches(CLI::App& command, StudyOptions& options);

}  // namespace isoshift
