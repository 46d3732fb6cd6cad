#include "setup/action.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <span>

namespace isoshift {

std::string_view to_string(Action action) {
  switch (action) {
    case Action::kUnset: return "unset";
    case Action::kWithin: return "within";
    case Action::kExceeds: return "exceeds";
  }
  return "";
}

ActionDecision decide_action(const ActionLevel& level, const std::array<std::optional<double>, 3>& translation_mm,
                             const std::array<std::optional<double>, 3>& rotation_deg) {
  ActionDecision decision;
  bool is_known = true;
  const auto compare = [&](const std::string& what, std::span<const std::optional<double>> values,
                           const std::optional<double>& limit, const char* unit) {
    if (!limit) return;
    constexpr std::array kAxes = {"x", "y", "z"};
    std::vector<std::string> beyond;
    for (std::size_t n = 0; n < values.size(); ++n) {
      is_known = is_known && values[n].has_value();
      if (values[n] && std::abs(*values[n]) > *limit) beyond.emplace_back(values.size() == 1 ? "" : kAxes[n]);
    }
    if (!beyond.empty())
      decision.reasons.push_back(fmt::format("{}{}: more than {} {}", what, fmt::join(beyond, ", "), *limit, unit));
  };
  // Of the length, what is known of it is the least it can be.
  double square_mm = 0.0;
  bool has_all = true;
  for (const std::optional<double>& component : translation_mm) {
    square_mm += component.value_or(0.0) * component.value_or(0.0);
    has_all = has_all && component;
  }
  const bool is_long = level.vector_mm && std::sqrt(square_mm) > *level.vector_mm;
  const std::array length = {has_all || is_long ? std::optional(std::sqrt(square_mm)) : std::nullopt};
  compare("setup error along ", translation_mm, level.translation_mm, "mm");
  compare("length of the translation", length, level.vector_mm, "mm");
  compare("setup error about ", rotation_deg, level.rotation_deg, "deg");
  decision.action = !decision.reasons.empty() ? Action::kExceeds : is_known ? Action::kWithin : Action::kUnset;
  return decision;
}

}  // namespace isoshift
