#pragma once
// The charts of an audit as SVG: one per axis, nothing where an axis has no values.

#include <string>
#include <vector>

#include "workflow/audit_setup/setup_audit.h"

namespace isoshift {

// Difference against mean of used and found, with bias and limits of agreement without outliers (Bland and Altman).
std::vector<std::string> agreement_charts(const SetupAudit& audit);

// Differences over time without outliers, with their drift if it is significant.
std::vector<std::string> difference_charts(const SetupAudit& audit);

// Setup errors over time, the first of a day, with their drift if it is significant.
std::vector<std::string> setup_charts(const SetupAudit& audit);

}  // namespace isoshift
