#pragma once
// The six numbers of a couch shift, along and about the table top's axes at imaging (IEC 61217, docs/conventions.md).

#include <array>
#include <optional>

namespace isoshift {

inline constexpr std::array kCouchAxes = {"lateral", "longitudinal", "vertical", "yaw", "pitch", "roll"};
inline constexpr std::array kCouchColumns = {"lateral_mm", "longitudinal_mm", "vertical_mm",
                                             "yaw_deg",    "pitch_deg",       "roll_deg"};
using CouchAxes = std::array<std::optional<double>, 6>;  // mm and degrees; empty: not known

}  // namespace isoshift
