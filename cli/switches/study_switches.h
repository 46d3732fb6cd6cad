#pragma once
// The flags that name a study's parts, supply what its files lack and allow what checks forbid: the same for every
// command that reads a study.

#include <CLI/CLI.hpp>

#include "workflow/register/study_options.h"

namespace isoshift {

void add_study_options(CLI::App& command, StudyOptions& options);
// Those that do not name its parts.
void add_study_switches(CLI::App& command, StudyOptions& options);

}  // namespace isoshift
