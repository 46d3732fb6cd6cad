#include "base/message.h"

#include <cstdint>
#include <nlohmann/json.hpp>
#include <vector>

namespace isoshift {

void to_json(nlohmann::json& json, const RawText& text) {
  json = text.bytes;
  try {
    (void)json.dump();
  } catch (const nlohmann::json::exception&) {
    json = std::vector<std::uint8_t>(text.bytes.begin(), text.bytes.end());
  }
}

void from_json(const nlohmann::json& json, RawText& text) {
  if (json.is_string()) {
    text.bytes = json.get<std::string>();
    return;
  }
  const auto bytes = json.get<std::vector<std::uint8_t>>();
  text.bytes.assign(bytes.begin(), bytes.end());
}

// Names of files, and what files say, may hold bytes that are no UTF-8: they are replaced.
std::string line_of(const nlohmann::json& message) {
  return message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace isoshift
