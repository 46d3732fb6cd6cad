#include "io/study/motion_trace.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/text_file.h"

namespace isoshift {
namespace {

std::vector<std::string> cells_of(std::string_view line, char separator) {
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == separator)
      cells.emplace_back();
    else if (c != '"' && c != '\r' && c != ' ')
      cells.back() += c;
  }
  return cells;
}

std::optional<std::size_t> column_named(const std::vector<std::string>& names, std::initializer_list<const char*> any) {
  for (const char* name : any)
    if (const auto found = std::ranges::find(names, name); found != names.end())
      return static_cast<std::size_t>(found - names.begin());
  return std::nullopt;
}

}  // namespace

std::vector<MotionSample> read_motion_trace(const std::filesystem::path& path, Notes& notes) {
  expect_no_pipe(path);
  std::ifstream file(path);
  std::string line;
  if (!std::getline(file, line)) throw Error(fmt::format("{}: cannot be read, or is empty", path.string()));
  if (line.starts_with("\xEF\xBB\xBF")) line.erase(0, 3);
  const char separator = line.find(';') != std::string::npos ? ';' : ',';
  const std::vector<std::string> names = cells_of(line, separator);
  const auto seconds = column_named(names, {"t_s", "time_s"}), milliseconds = column_named(names, {"Timestamp"});
  const std::array columns = {column_named(names, {"measured_x_mm", "x_mm", "x"}),
                              column_named(names, {"measured_y_mm", "y_mm", "y"}),
                              column_named(names, {"measured_z_mm", "z_mm", "z"})};
  if ((!seconds && !milliseconds) || !columns[0] || !columns[1] || !columns[2])
    throw Error(
        fmt::format("{}: has the columns {}; expected t_s (or Timestamp, in ms) and x, y, z (or x_mm, or "
                    "measured_x_mm, ...)",
                    path.string(), fmt::join(names, ", ")));

  std::vector<MotionSample> trace;
  for (int number = 2; std::getline(file, line); ++number) {
    const std::vector<std::string> cells = cells_of(line, separator);
    if (cells.size() == 1 && cells.front().empty()) continue;
    const auto value_of = [&](std::size_t column) -> std::optional<double> {
      if (column >= cells.size() || cells[column].empty()) return std::nullopt;
      std::string text = cells[column];
      if (separator == ';') std::ranges::replace(text, ',', '.');
      double value = 0.0;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
      if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
        throw Error(fmt::format("{}, line {}: \"{}\" is not a number", path.string(), number, cells[column]));
      return value;
    };
    const auto time = value_of(seconds ? *seconds : *milliseconds);
    const auto x = value_of(*columns[0]), y = value_of(*columns[1]), z = value_of(*columns[2]);
    if (!time) throw Error(fmt::format("{}, line {}: has no time", path.string(), number));
    if (x && y && z) trace.push_back({seconds ? *time : *time / 1000.0, {*x, *y, *z}});
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
    throw Error(fmt::format("{}: the times of {} of {} rows do not increase", path.string(), wrong, trace.size()));
  if (wrong > 0)
    notes.warnings.push_back(fmt::format("{}: {} of {} rows have a time before that of the row above, and were skipped",
                                         path.string(), wrong, trace.size()));
  return in_order;
}

}  // namespace isoshift
