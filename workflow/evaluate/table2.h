#pragma once
// Table 2 of the founding paper: one evaluation per configuration, and a table of all of them.

#include <string>
#include <vector>

#include "workflow/evaluate/evaluate_study.h"

namespace isoshift {

// Runs the configurations with these names (all if there are none), each in a folder of its name in options.output, and
// writes table2.md and table2.csv there after each of them. Of `options`, the search and the starts are replaced by
// those of the configuration; `options.protocol.count` is the largest number of starts. Continues where it was stopped.
// Returns the table.
std::string evaluate_table2(const EvaluateOptions& options, const std::vector<std::string>& names, Notes& notes,
                            Observer& observer);

}  // namespace isoshift
