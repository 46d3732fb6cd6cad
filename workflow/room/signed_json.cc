#include "workflow/room/signed_json.h"

#include "base/json_file.h"

namespace isoshift {
namespace {

constexpr const char* kSignatureKey = "signature";

// What is signed: all of it, with its keys sorted, in as few characters as JSON allows.
std::string signed_text(nlohmann::json record) {
  record.erase(kSignatureKey);
  return record.dump();
}

}  // namespace

std::string file_text(const nlohmann::ordered_json& json) { return json_text(json); }

void sign(nlohmann::ordered_json& record, const std::optional<SigningKey>& key) {
  if (key) record[kSignatureKey] = key->sign(signed_text(nlohmann::json::parse(file_text(record))));
}

bool is_signed(const nlohmann::json& record, const std::optional<SigningKey>& key) {
  if (!key) return true;
  const nlohmann::json signature =
      record.is_object() ? record.value(kSignatureKey, nlohmann::json()) : nlohmann::json();
  return signature.is_string() && key->has_signed(signed_text(record), signature);
}

}  // namespace isoshift
