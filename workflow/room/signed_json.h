#pragma once
// Records of what people have released and decided: JSON that the key of a watch file has signed.

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "base/signing_key.h"

namespace isoshift {

// As it stands in a file. A label or the name of a file need not be UTF-8.
std::string file_text(const nlohmann::ordered_json& json);

// Adds a signature of all of the record. Without a key: nothing.
void sign(nlohmann::ordered_json& record, const std::optional<SigningKey>& key);

// Whether the key has signed the record. Without a key: true.
bool is_signed(const nlohmann::json& record, const std::optional<SigningKey>& key);

}  // namespace isoshift
