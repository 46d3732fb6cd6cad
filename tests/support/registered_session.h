#pragma once
// A session in a results tree, as watch leaves it, without a registration.

#include <string>
#include <vector>

#include "workflow/room/results_tree.h"

namespace isoshift {

// What isoshift register would leave of these X-rays: result.json, report.dcm and, if accepted, a registration object.
// Returns the session's name.
std::string write_registering(const ResultsTree& tree, const std::vector<std::string>& xrays,
                              const std::string& verdict);

// The same, registered.
std::string register_session(ResultsTree& tree, const std::vector<std::string>& xrays, const std::string& verdict);

}  // namespace isoshift
