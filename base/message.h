#pragma once
// Messages between processes: a JSON object per line. Each message is a struct with a function to_line() and a reader.
// The reader uses JsonSection (base/json_file.h), so that its errors name every mistake.

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace isoshift {

// A text that may hold any bytes, as names of files do. JSON holds UTF-8 only: any other text becomes a list of bytes.
struct RawText {
  std::string bytes;
};
void to_json(nlohmann::json& json, const RawText& text);
void from_json(const nlohmann::json& json, RawText& text);

// The message as a line, with its end.
std::string line_of(const nlohmann::json& message);

}  // namespace isoshift
