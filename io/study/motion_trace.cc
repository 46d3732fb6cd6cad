#include "io/study/motion_trace.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>

#include "base/csv.h"
#include "base/error.h"
#include "base/text_file.h"

namespace isoshift {
namespace {

constexpr double kFarthestMm = 10000.0;

// What another program's file seems to be; empty: nothing that is known here.
std::string curve_of_other_program(std::string_view text) {
  const auto has = [&](std::string_view words) { return text.substr(0, 2000).find(words) != std::string_view::npos; };
  if (has("[Header]") && has("Data_layout="))
    return "It looks like a breathing curve of Varian RPM (.vxp): one amplitude over time is no position";
  if (has("Amplitude"))
    return "It looks like the breathing curve of a gating system: one amplitude over time is no position";
  return "";
}

// Which columns hold the time and the position.
struct Columns {
  std::size_t time = 0;
  double seconds_per_unit = 1.0;
  std::array<std::size_t, 3> position{};
};

Columns columns_of(const std::vector<std::string>& titles, const std::string& where, const std::string& hint) {
  std::vector<std::string> names = titles;
  for (std::string& name : names) std::erase(name, ' ');
  const auto one_of = [&](std::initializer_list<std::string_view> any) {
    std::optional<std::size_t> found;
    for (std::size_t n = 0; n < names.size(); ++n) {
      if (std::ranges::find(any, names[n]) == any.end()) continue;
      if (found)
        throw Error(fmt::format("{}: has the columns {} and {}, expected one of them", where, names[*found], names[n]));
      found = n;
    }
    return found;
  };
  const auto time = one_of({"t_s", "time_s", "Timestamp"});
  const std::array position = {one_of({"measured_x_mm", "x_mm", "x"}), one_of({"measured_y_mm", "y_mm", "y"}),
                               one_of({"measured_z_mm", "z_mm", "z"})};
  if (!time || !position[0] || !position[1] || !position[2])
    throw Error(
        fmt::format("{}: has the columns {}; expected t_s (or Timestamp, in ms) and x, y, z (or x_mm, or "
                    "measured_x_mm, ...), in the first line of a table (CSV){}{}",
                    where, fmt::join(names, ", "), hint.empty() ? "" : ".\n       ", hint));
  return {.time = *time,
          .seconds_per_unit = names[*time] == "Timestamp" ? 1e-3 : 1.0,
          .position = {*position[0], *position[1], *position[2]}};
}

// The longest time for which what `value_of` takes of a position stays the same to the last digit.
struct Standstill {
  double length_s = 0.0, from_s = 0.0;
  std::size_t steps = 0;    // of the standstill
  std::size_t changes = 0;  // in the whole trace
};
template <typename ValueOf>
Standstill longest_standstill(const std::vector<MotionSample>& trace, const ValueOf& value_of) {
  Standstill longest;
  std::size_t first = 0;
  for (std::size_t n = 0; n < trace.size(); ++n) {
    if (value_of(trace[n]) != value_of(trace[first])) first = n, ++longest.changes;
    if (const double length_s = trace[n].time_s - trace[first].time_s; length_s > longest.length_s) {
      longest.length_s = length_s;
      longest.from_s = trace[first].time_s;
      longest.steps = n - first;
    }
  }
  return longest;
}

// A recorder that has lost its target may repeat the last position, or one coordinate of it; a target that is there
// moves by a little. A coordinate that changes in less than half of the other steps is a coarse one, which may rest.
void warn_of_standstill(const std::vector<MotionSample>& trace, const std::string& where, Notes& notes) {
  constexpr double kLongS = 3.0;
  const auto warn = [&](const Standstill& still, std::string_view what) {
    notes.warnings.push_back(
        fmt::format("{}: {} stands still to the last digit for {:.1f} s, from {:.1f} s on: was the target lost there? "
                    "Leave such rows empty, or out",
                    where, what, still.length_s, still.from_s));
  };
  const Standstill whole = longest_standstill(trace, [](const MotionSample& sample) { return sample.position_mm; });
  if (whole.changes > 0 && whole.length_s >= kLongS) return warn(whole, "the position");
  for (int axis = 0; axis < 3; ++axis) {
    const Standstill one =
        longest_standstill(trace, [&](const MotionSample& sample) { return sample.position_mm[axis]; });
    const bool moves_else = one.changes > 0 && 2 * one.changes >= trace.size() - 1 - one.steps;
    if (moves_else && one.length_s >= kLongS)
      warn(one, fmt::format("{}, while the others move,", std::array{"x", "y", "z"}[static_cast<std::size_t>(axis)]));
  }
}

// Nothing in a body moves that fast: a recorder writes such numbers where it has lost its target, or takes another one
// for it.
void warn_of_jumps(const std::vector<MotionSample>& trace, const std::string& where, Notes& notes) {
  constexpr double kFarMm = 10.0, kFastMmPerS = 200.0;
  std::size_t jumps = 0, first = 0;
  for (std::size_t n = 1; n < trace.size(); ++n) {
    const double way_mm = (trace[n].position_mm - trace[n - 1].position_mm).norm();
    if (way_mm < kFarMm || way_mm < kFastMmPerS * (trace[n].time_s - trace[n - 1].time_s)) continue;
    if (jumps++ == 0) first = n;
  }
  if (jumps == 0) return;
  const MotionSample &to = trace[first], &from = trace[first - 1];
  notes.warnings.push_back(fmt::format(
      "{}: the position jumps {} times by {:g} mm or more, first by {:.0f} mm in {:.3f} s, at {:.1f} s: was "
      "the target lost there? Leave such rows empty, or out",
      where, jumps, kFarMm, (to.position_mm - from.position_mm).norm(), to.time_s - from.time_s, to.time_s));
}

}  // namespace

std::vector<MotionSample> read_motion_trace(const std::filesystem::path& path, Notes& notes) {
  const std::string text = text_of_file(path), where = path.string();
  if (text.empty()) throw Error(fmt::format("{}: is empty", where));
  const char separator = text.substr(0, text.find_first_of("\r\n")).find(';') != std::string::npos ? ';' : ',';
  const std::string first_line = text.substr(0, text.find_first_of("\r\n")), hint = curve_of_other_program(text);
  if (!hint.empty()) columns_of(csv_table(first_line, where, separator).columns, where, hint);
  const CsvTable table = csv_table(text, where, separator);
  const Columns columns = columns_of(table.columns, where, hint);
  std::vector<MotionSample> trace;
  for (const CsvTable::Row& row : table.rows) {
    const auto value_of = [&](std::size_t column) -> std::optional<double> {
      std::string cell = row.cells[column];
      if (cell.find_first_not_of(" \t") == std::string::npos) return std::nullopt;
      if (separator == ';') std::ranges::replace(cell, ',', '.');
      const std::optional<double> value = number_in_cell(cell);
      if (!value) throw Error(fmt::format("{}, line {}: \"{}\" is not a number", where, row.line, row.cells[column]));
      return value;
    };
    const auto time = value_of(columns.time);
    if (!time) throw Error(fmt::format("{}, line {}: has no time", where, row.line));
    Eigen::Vector3d position_mm;
    std::size_t there = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto value = value_of(columns.position[axis]);
      if (value && std::abs(*value) > kFarthestMm)
        throw Error(fmt::format("{}, line {}: {} is {} mm, expected {} to {}", where, row.line,
                                table.columns[columns.position[axis]], *value, -kFarthestMm, kFarthestMm));
      if (value) ++there;
      position_mm[static_cast<Eigen::Index>(axis)] = value.value_or(0.0);
    }
    if (there == 3)
      trace.push_back({columns.seconds_per_unit * *time, position_mm});
    else if (there > 0)
      throw Error(fmt::format("{}, line {}: has {} of 3 coordinates, expected all or none", where, row.line, there));
  }
  while (trace.size() > 1 && trace.back().position_mm.isZero(0.0) &&
         trace.back().time_s <= trace[trace.size() - 2].time_s)
    trace.pop_back();

  // Recorders now and then write a wrong time: such rows are left out as long as they are few.
  constexpr double kMostShare = 0.01;
  std::vector<MotionSample> in_order;
  for (const MotionSample& sample : trace)
    if (in_order.empty() || sample.time_s > in_order.back().time_s) in_order.push_back(sample);
  const std::size_t wrong = trace.size() - in_order.size();
  if (static_cast<double>(wrong) > kMostShare * static_cast<double>(trace.size()))
    throw Error(fmt::format("{}: the times of {} of {} rows do not increase", where, wrong, trace.size()));
  if (wrong > 0)
    notes.warnings.push_back(fmt::format("{}: {} of {} rows have a time before that of the row above, and were skipped",
                                         where, wrong, trace.size()));
  warn_of_jumps(in_order, where, notes);
  warn_of_standstill(in_order, where, notes);
  return in_order;
}

}  // namespace isoshift
