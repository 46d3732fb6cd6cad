#include "base/option_name.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <utility>

namespace isoshift {
namespace {

std::atomic<OptionStyle>& style_now() {
  static std::atomic<OptionStyle> style = OptionStyle::kNamed;
  return style;
}

// Arguments whose names are not those of the flags: they hold the unit, or are of several things.
constexpr std::array<std::pair<std::string_view, std::string_view>, 8> kArguments = {{
    {"image", "images"},
    {"sad", "sad_mm"},
    {"sid", "sid_mm"},
    {"couch-angle", "couch_angle_deg"},
    {"couch-pitch", "couch_pitch_deg"},
    {"couch-roll", "couch_roll_deg"},
    {"gantry-angle", "gantry_angles_deg"},
    {"threshold", "threshold_hu"},
}};

std::string argument(std::string_view flag) {
  const auto other = std::ranges::find(kArguments, flag, &std::pair<std::string_view, std::string_view>::first);
  std::string name(other == kArguments.end() ? flag : other->second);
  std::ranges::replace(name, '-', '_');
  return name;
}

}  // namespace

void name_options(OptionStyle style) { style_now() = style; }

std::string option(std::string_view name, std::string_view value) {
  const bool is_flag = style_now() == OptionStyle::kFlags;
  std::string text = is_flag ? std::string("--").append(name) : argument(name);
  const bool is_in_name = !is_flag && (value == "MM" || value == "DEG");
  if (value.empty() || is_in_name) return text;
  return text.append(is_flag ? " " : "=").append(value);
}

}  // namespace isoshift
