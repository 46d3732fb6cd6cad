#include "io/dicom/notes.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/option_name.h"

namespace isoshift {

std::vector<FailedCheck> not_allowed(const std::vector<FailedCheck>& findings, const Allowances& allowed,
                                     Notes& notes) {
  std::vector<FailedCheck> others;
  for (const FailedCheck& finding : findings) {
    if (const auto reason = allowed.find(finding.key); reason != allowed.end())
      notes.overrides.push_back(fmt::format("{} (allowed by {}: {})", finding.message, finding.key, reason->second));
    else
      others.push_back(finding);
  }
  return others;
}

std::vector<std::string> unsettled(const std::vector<FailedCheck>& findings, const Allowances& allowed, Notes& notes) {
  std::vector<std::string> doubts;
  for (const FailedCheck& finding : not_allowed(findings, allowed, notes))
    doubts.push_back(fmt::format("{} ({})", finding.message, option("allow", fmt::format("{}=REASON", finding.key))));
  return doubts;
}

void settle(const std::vector<FailedCheck>& findings, const Allowances& allowed, Notes& notes) {
  std::string refused;
  for (const FailedCheck& finding : not_allowed(findings, allowed, notes))
    refused += fmt::format(
        "{}{}\n"
        "       If that is known to be right, allow it: {}",
        refused.empty() ? "" : "\n", finding.message, option("allow", fmt::format("{}=REASON", finding.key)));
  if (!refused.empty()) throw Error(refused);
}

}  // namespace isoshift
