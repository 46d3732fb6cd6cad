#pragma once
// Findings that make a verdict, for tests of what is done with it.

#include <string>
#include <utility>
#include <vector>

#include "setup/finding.h"

namespace isoshift {

inline std::vector<Finding> findings_for(Verdict verdict, std::string words = "the views disagree") {
  if (verdict == Verdict::kAccepted) return {};
  return {{.check = Check::kFiles, .consequence = verdict, .words = std::move(words)}};
}

}  // namespace isoshift
