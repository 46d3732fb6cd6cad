#include "workflow/room/decision.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"

namespace isoshift {
namespace {

// Of a decision on a page.
std::string_view done(DecisionKind kind) {
  switch (kind) {
    case DecisionKind::kAgreed: return "agreed to";
    case DecisionKind::kRejected: return "rejected";
    case DecisionKind::kRepeat: return "to be repeated: decided";
    case DecisionKind::kReopened: return "taken up again";
  }
  return "";
}

}  // namespace

std::string_view to_string(DecisionKind kind) {
  switch (kind) {
    case DecisionKind::kAgreed: return "agreed";
    case DecisionKind::kRejected: return "rejected";
    case DecisionKind::kRepeat: return "repeat";
    case DecisionKind::kReopened: return "reopened";
  }
  return "";
}

std::optional<DecisionKind> decision_kind_from(std::string_view word) {
  const auto* found = std::ranges::find(kDecisionKinds, word, [](DecisionKind kind) { return to_string(kind); });
  return found == kDecisionKinds.end() ? std::nullopt : std::optional(*found);
}

std::string in_words(const Decision& decision) {
  return fmt::format("{} by {} on {}{}{}", done(decision.kind), decision.by, decision.on,
                     decision.reason.empty() ? "" : ": ", decision.reason);
}

nlohmann::ordered_json json_of(const Decision& decision) {
  return {{"schema", 1},
          {"session", decision.session},
          {"decision", to_string(decision.kind)},
          {"reason", decision.reason},
          {"by", decision.by},
          {"user", decision.user},
          {"on", decision.on},
          {"record", decision.record}};
}

Decision decision_from(const nlohmann::json& json) {
  const std::optional<DecisionKind> kind = decision_kind_from(json.at("decision").get<std::string>());
  if (!kind) throw Error("its decision is not one that isoshift knows");
  return {.kind = *kind,
          .session = json.at("session"),
          .record = json.at("record"),
          .reason = json.at("reason"),
          .by = json.at("by"),
          .user = json.at("user"),
          .on = json.at("on")};
}

}  // namespace isoshift
