#include "io/notes.h"

#include <fmt/format.h>

#include "geometry/error.h"

namespace isoshift {

void settle(const std::vector<Finding>& findings, const Allowances& allowed, Notes& notes) {
  std::string refused;
  for (const Finding& finding : findings) {
    if (const auto reason = allowed.find(finding.key); reason != allowed.end()) {
      notes.overrides.push_back(fmt::format("{} (allowed by {}: {})", finding.message, finding.key, reason->second));
      continue;
    }
    if (!refused.empty()) refused += '\n';
    refused += fmt::format("{}\n       If that is known to be right, allow it: --allow {}=REASON", finding.message,
                           finding.key);
  }
  if (!refused.empty()) throw Error(refused);
}

}  // namespace isoshift
