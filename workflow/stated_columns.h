#pragma once
// The six numbers of a shift or a pose in tables of people: the names of the columns state their units, and people err
// in them.

#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/csv.h"

namespace isoshift {

using SixNames = std::array<const char*, 6>;  // three lengths ("x_mm"), three angles ("rx_deg")
using SixNumbers = std::array<std::optional<double>, 6>;

// A column as a table states it: "x_cm", 10 times whose numbers are mm.
struct StatedColumn {
  std::string name;
  double unit = 1.0;
  std::size_t place = 0;  // of its cells in a row
};
// The columns of `table` that stand for `names`: in the same units, or in cm for mm and in rad for deg. Throws Error,
// naming `where`, for a column that stands there in two units.
std::array<std::optional<StatedColumn>, 6> stated_columns(const CsvTable& table, const SixNames& names,
                                                          const std::string& where);

// What a table states of a session, and what was found, in mm and degrees.
struct StatedAndFound {
  std::string name;  // of the session
  SixNumbers stated, found;
};
// Throws Error, naming the columns and what they seem to hold, if the table, or the numbers of some sessions, fit far
// better to what was found in other units (cm, inch, m, rad) or with columns exchanged. Signs do not matter.
void check_columns(const std::array<std::optional<StatedColumn>, 6>& columns, std::span<const StatedAndFound> sessions,
                   const std::string& where);

}  // namespace isoshift
