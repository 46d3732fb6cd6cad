#include "base/option_name.h"

#include <algorithm>
#include <atomic>

namespace isoshift {
namespace {

std::atomic<OptionStyle>& style_now() {
  static std::atomic<OptionStyle> style = OptionStyle::kNamed;
  return style;
}

}  // namespace

void name_options(OptionStyle style) { style_now() = style; }

std::string option(std::string_view name, std::string_view value) {
  const bool is_flag = style_now() == OptionStyle::kFlags;
  std::string text(name);
  if (is_flag) {
    text.insert(0, "--");
    return value.empty() ? text : text.append(" ").append(value);
  }
  std::ranges::replace(text, '-', '_');
  if (value == "MM" || value == "DEG") return text.append(value == "MM" ? "_mm" : "_deg");
  return value.empty() ? text : text.append("=").append(value);
}

}  // namespace isoshift
