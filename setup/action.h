#pragma once
// Whether a setup error is larger than the site's action level, so that a person must act. Independent of the verdict.

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "setup/site_rules.h"

namespace isoshift {

// kUnset: there is no action level, or the setup error is not known well enough to tell.
enum class Action { kUnset, kWithin, kExceeds };
std::string_view to_string(Action action);

struct ActionDecision {
  Action action = Action::kUnset;
  std::vector<std::string> reasons;  // what exceeds the level
};

// By the setup error as it is, before any rounding. Components that were not determined or searched are absent.
ActionDecision decide_action(const ActionLevel& level, const std::array<std::optional<double>, 3>& translation_mm,
                             const std::array<std::optional<double>, 3>& rotation_deg);

}  // namespace isoshift
