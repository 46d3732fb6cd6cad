#include "cli/switches/text_on_one_line.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <tuple>

#include "base/error.h"

namespace isoshift {

void check_text_on_one_line(const std::string& flag, const std::string& text, const std::string& expected) {
  if (text.find_first_not_of(' ') == std::string::npos)
    throw UsageError(fmt::format("{}: expected {}", flag, expected));
  if (text.starts_with(' ') || text.ends_with(' '))
    throw UsageError(fmt::format("{}: begins or ends with a space; expected {}", flag, expected));
  const auto is_control = [](unsigned char c) { return c < 0x20 || c == 0x7F; };
  if (std::ranges::any_of(text, is_control))
    throw UsageError(
        fmt::format("{}: holds a line break or another control character; expected {} on one line", flag, expected));
  try {
    std::ignore = nlohmann::json(text).dump();
  } catch (const nlohmann::json::exception&) {
    throw UsageError(fmt::format("{}: is not valid UTF-8 text; expected {}", flag, expected));
  }
}

}  // namespace isoshift
