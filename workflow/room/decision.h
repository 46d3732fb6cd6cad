#pragma once
// What a person has decided about a result, other than to release it.

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace isoshift {

enum class DecisionKind {
  kAgreed,    // a second person agrees with the result, which another person may then release
  kRejected,  // the result is not to be used
  kRepeat,    // the X-rays are to be taken again: the result is not to be used
  kReopened   // an earlier decision is taken back
};
inline constexpr std::array kDecisionKinds = {DecisionKind::kAgreed, DecisionKind::kRejected, DecisionKind::kRepeat,
                                              DecisionKind::kReopened};
std::string_view to_string(DecisionKind kind);  // "agreed", "rejected", "repeat", "reopened"
std::optional<DecisionKind> decision_kind_from(std::string_view word);

struct Decision {
  DecisionKind kind = DecisionKind::kRejected;
  std::string session;
  std::string record;    // SHA-256 of the record of the result that was decided about
  std::string reason;    // in the person's words; may be empty if the person agrees
  std::string by, user;  // the person, and the user of the system
  std::string on;        // local time

  // Whether the result may not be released or sent as long as the decision stands.
  bool forbids() const { return kind == DecisionKind::kRejected || kind == DecisionKind::kRepeat; }
};

// "rejected by J. Doe on 2026-03-01T10:20:00+0100: the patient coughed".
std::string in_words(const Decision& decision);

nlohmann::ordered_json json_of(const Decision& decision);
// Throws nlohmann::json::exception or Error for anything else.
Decision decision_from(const nlohmann::json& json);

}  // namespace isoshift
