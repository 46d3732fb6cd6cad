#pragma once
// What a run must tell its user beside the result: warnings, overrides of what a file lacks or a check forbids, and
// files that were found and not used.

#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace isoshift {

struct Notes {
  std::vector<std::string> warnings;
  std::vector<std::string> overrides;
  std::vector<std::string> left_aside;  // files found and not used, with the reason
};

// What a person allows although a check forbids it: key (kAllowKeys) to reason, from --allow KEY=REASON.
using Allowances = std::map<std::string, std::string, std::less<>>;

struct AllowKey {
  std::string_view key;
  std::string_view meaning;
};
inline constexpr AllowKey kAllowKeys[] = {
    {"patient-mismatch", "inputs of different patients"},
    {"for-mismatch", "plan or structures and CT in different frames of reference"},
    {"plan-mismatch",
     "an X-ray that refers to another plan, another isocenter than the plan's, or angles that are not the beam's"},
    {"planned-geometry", "a geometry that is planned or typed in, not measured (ReportedValuesOrigin)"},
    {"gaps", "a CT with missing slices or uneven spacing, interpolated"},
    {"drr", "an RT Image that is itself a DRR"},
    {"time-span", "views more than 10 minutes apart"},
    {"table-moved", "a table that moved between the views"},
};

// A check that failed. If its key is allowed, the finding becomes an override; else it must stop the run.
struct FailedCheck {
  std::string_view key;
  std::string message;
};

// Moves allowed findings to notes.overrides and returns the others.
std::vector<FailedCheck> not_allowed(const std::vector<FailedCheck>& findings, const Allowances& allowed, Notes& notes);

// The same as doubts, each with the --allow switch that settles it.
std::vector<std::string> unsettled(const std::vector<FailedCheck>& findings, const Allowances& allowed, Notes& notes);

// Moves allowed findings to notes.overrides; throws one Error with all the others, each naming its --allow switch.
void settle(const std::vector<FailedCheck>& findings, const Allowances& allowed, Notes& notes);

}  // namespace isoshift
