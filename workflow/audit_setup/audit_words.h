#pragma once
// The findings of an audit in words, for the terminal and the page. Patients are not named: sessions are.

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "workflow/audit_setup/setup_audit.h"

namespace isoshift {

// "2026-03-01", of days since 1970.
std::string date_of(double day);

// What changed: "+0.21 +/- 0.05 mm per 30 days", "a step of +1.90 +/- 0.30 mm on or shortly before 2026-05-04".
std::string in_words(const Drift& drift, std::size_t axis);

// What stands out: "lateral: used +3.1, found -3.0 mm".
std::string in_words(const SetupAudit::Outlier& outlier, const SetupAudit& audit);

// What is to be said of one session: why it is left out, or what makes it an outlier; empty: nothing.
std::string remark_on(std::size_t session, const SetupAudit& audit);

inline constexpr std::array kSetupAxes = {"x", "y", "z", "about x", "about y", "about z"};  // of kErrorComponents

std::string counts_of(const SetupAudit& audit);

// A line for each significant drift; else that there is none, or that too few sessions tell.
std::vector<std::string> drifts_of_differences(const SetupAudit& audit);
std::vector<std::string> drifts_of_setup(const SetupAudit& audit);
// A line for each axis of which the signs look wrong.
std::vector<std::string> doubtful_axes(const SetupAudit& audit);

// What the numbers rest on.
std::string meaning_of_outliers(const SetupAudit& audit);
inline constexpr const char* kMeaningOfDrift =
    "A drift is called if a line or a step in time is significant at 5 % by Student's t, between the means of patients "
    "or within patients, after Bonferroni's correction for both, both shapes, all dates tried and six axes: of a "
    "hundred audits without a change at most about five call one.";
inline constexpr const char* kMeaningOfMargins =
    "Margin: 2.5 Sigma + 0.7 sigma (van Herk et al., Int J Radiat Oncol Biol Phys 47, 2000): 90 % of patients get at "
    "least 95 % of the dose in all of a large, rigid target, with many fractions, normal errors and the penumbra of "
    "photons in water. Translations only; the mean M, delineation, motion within a fraction and rotations are not in "
    "it. Sigma and sigma hold the uncertainty of isoshift, too, and Sigma that of means over few fractions.";

// All of it, for the terminal.
std::string audit_text(const SetupAudit& audit);

}  // namespace isoshift
