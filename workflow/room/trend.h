#pragma once
// A patient's results over time: each setup error with the site's action level and what became of the result, and the
// patient's systematic and random error.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "setup/setup_errors.h"
#include "setup/site_rules.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/session_list.h"

namespace isoshift {

struct Trend {
  struct Result {
    ListedSession session;
    std::string plan;                                 // its label
    std::array<std::optional<double>, 6> components;  // as shown in the report: kErrorComponents
    std::optional<ActionLevel> level;
    std::string left_out;  // why it does not count in `errors`; empty: it does
  };
  std::vector<Result> results;          // the oldest first
  std::optional<PatientErrors> errors;  // of the results that count; nothing: none does
};

// `sessions`: all of one patient. Counted is the first result of every day that was accepted or released, that stands,
// and of which all components are known: later ones of a day show what the couch shift has left.
Trend trend_of(const ResultsTree& tree, std::vector<ListedSession> sessions);

}  // namespace isoshift
