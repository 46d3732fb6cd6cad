#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/csv.h"
#include "base/error.h"
#include "base/sha256.h"
#include "base/text_file.h"
#include "geometry/motion_axes.h"
#include "workflow/audit_setup/used_shifts.h"
#include "workflow/stated_columns.h"

namespace isoshift {
namespace {

constexpr const char* kSessionColumn = "session";

// Consoles show a turn by -0.8 degrees as 359.2.
std::optional<double> number_of(const std::string& cell, double unit, bool is_angle, const std::string& where) {
  if (cell.find_first_not_of(" \t") == std::string::npos) return std::nullopt;
  const auto value = number_in_cell(cell);
  if (!value)
    throw Error(fmt::format("{}: \"{}\" is not a finite number; expected a number with a decimal point, or nothing",
                            where, cell));
  constexpr double kMostMm = 1000.0, kTurnDeg = 360.0;  // no couch moves that far
  const double most = is_angle ? kTurnDeg : kMostMm, in_unit = unit * *value;
  if (std::abs(in_unit) > most)
    throw Error(fmt::format("{}: {:g} is no couch shift; expected at most {:g} {}", where, *value, most,
                            is_angle ? "degrees" : "mm"));
  return is_angle ? std::remainder(in_unit, kTurnDeg) : in_unit;
}

}  // namespace

std::string used_shifts_header() { return fmt::format("{},{}", kSessionColumn, fmt::join(kCouchColumns, ",")); }

std::string read_used_table(const std::filesystem::path& table, std::vector<AuditedSession>& sessions) {
  const std::string where = table.string();
  const std::string text = text_of_file(table);
  const CsvTable rows = csv_table(text, where);
  const auto columns = stated_columns(rows, kCouchColumns, where);
  const auto session_column = std::ranges::find(rows.columns, kSessionColumn);
  const auto known =
      static_cast<std::size_t>(std::ranges::count_if(columns, [](const auto& column) { return column.has_value(); }));
  if (session_column == rows.columns.end() || known == 0 || rows.columns.size() != known + 1)
    throw Error(fmt::format("{}, line 1: the columns are \"{}\", expected {} (or in cm and rad: lateral_cm, yaw_rad)",
                            where, fmt::join(rows.columns, ","), used_shifts_header()));
  if (rows.rows.empty()) throw Error(fmt::format("{}: names no session", where));
  std::map<std::string, AuditedSession*> by_name;
  for (AuditedSession& session : sessions) by_name[session.name] = &session;
  for (const auto& [number, cells] : rows.rows) {
    const std::string line = fmt::format("{}, line {}", where, number);
    const std::string& name = cells[static_cast<std::size_t>(session_column - rows.columns.begin())];
    const auto found = by_name.find(name);
    if (found == by_name.end())
      throw Error(fmt::format(
          "{}, column session: there is no session \"{}\"; the folder of the result has this name, with the folders "
          "above it where two have one name (as in \"{}\")",
          line, name, sessions.front().name));
    AuditedSession& session = *found->second;
    if (!session.used_from.empty())
      throw Error(fmt::format("{}, column session: \"{}\" is there twice; the first time in {}", line, session.name,
                              session.used_from));
    session.used_from = line;
    for (std::size_t axis = 0; axis < session.used.size(); ++axis)
      if (const auto& column = columns[axis])
        session.used[axis] = number_of(cells[column->place], column->unit, is_rotation(axis),
                                       fmt::format("{}, column {}", line, column->name));
  }
  std::vector<StatedAndFound> compared;
  for (const AuditedSession& session : sessions)
    if (session.counts()) compared.push_back({.name = session.name, .stated = session.used, .found = session.found});
  check_columns(columns, compared, where);
  return sha256_of(text);
}

}  // namespace isoshift
