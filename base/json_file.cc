#include "base/json_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/sha256.h"
#include "base/text_file.h"

namespace isoshift {

std::string reason_of(const nlohmann::json::exception& error) {
  const std::string what = error.what();  // "[json.exception.parse_error.101] ..."
  const std::size_t end = what.find("] ");
  return end == std::string::npos ? what : what.substr(end + 2);
}

nlohmann::json json_from(const std::string& text, const std::string& where) {
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  const auto check_keys = [&](int, nlohmann::json::parse_event_t event, const nlohmann::json& parsed) {
    using Event = nlohmann::json::parse_event_t;
    if (event == Event::object_start) keys.emplace_back();
    if (event == Event::object_end) keys.pop_back();
    if (event == Event::key && !keys.back().insert(parsed.get<std::string>()).second)
      throw Error(fmt::format("{}: says {} twice", where, parsed.get<std::string>()));
    return true;
  };
  try {
    return nlohmann::json::parse(text, check_keys);
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: is not JSON: {}", where, reason_of(error)));
  }
}

JsonFile read_json_file(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path))
    throw Error(fmt::format("{}: is a folder, expected a JSON file", path.string()));
  std::string content = text_of_file(path);
  nlohmann::json json = json_from(content, path.string());
  std::string sha256 = sha256_of(content);
  return {.json = std::move(json), .text = std::move(content), .sha256 = std::move(sha256)};
}

JsonSection::JsonSection(const nlohmann::json& json, std::string where) : json_(json), where_(std::move(where)) {
  if (!json_.is_object()) throw Error(fmt::format("{}: expected an object", where_));
}

void JsonSection::know(const char* key) {
  if (std::ranges::find(known_, key) == known_.end()) known_.emplace_back(key);
}

std::optional<double> JsonSection::number(const char* key, double low, double high) {
  const auto value = find<double>(key, "a number");
  if (value && !(*value >= low && *value <= high))
    throw Error(fmt::format("{}: {} is {}, expected {} to {}", where_, key, *value, low, high));
  return value;
}

std::optional<JsonSection> JsonSection::section(const char* key) {
  know(key);
  if (!json_.contains(key)) return std::nullopt;
  return JsonSection(json_.at(key), fmt::format("{}: {}", where_, key));
}

void JsonSection::refuse(const char* key, const char* expected) const {
  throw Error(fmt::format("{}: {} is {}, expected {}", where_, key, json_.at(key).dump(), expected));
}

void JsonSection::refuse_missing(const char* key, const char* expected) const {
  throw Error(fmt::format("{}: {} is missing, expected {}", where_, key, expected));
}

void JsonSection::end() const {
  for (const auto& [key, value] : json_.items())
    if (std::ranges::find(known_, key) == known_.end())
      throw Error(fmt::format("{}: there is no key {}; the keys are {}", where_, key, fmt::join(known_, ", ")));
}

}  // namespace isoshift
