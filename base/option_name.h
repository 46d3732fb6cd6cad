#pragma once
// How a message names an option. Libraries know options by name; only a program knows how its users give them.
//
//   throw Error(fmt::format("{} is missing.\n       Supply it: {}", described(tag), option("sid", "MM")));

#include <string>
#include <string_view>

namespace isoshift {

enum class OptionStyle {
  kNamed,  // couch_angle_deg, isocenter=X,Y,Z: as arguments of functions are named
  kFlags,  // --couch-angle DEG: of a command line
};

// From now on, in this process; until then kNamed.
void name_options(OptionStyle style);

// `name` as a flag has it, without dashes before it.
std::string option(std::string_view name, std::string_view value = {});

}  // namespace isoshift
