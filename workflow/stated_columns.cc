#include "workflow/stated_columns.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include "base/error.h"

namespace isoshift {
namespace {

using Columns = std::array<std::optional<StatedColumn>, 6>;

constexpr double kMmPerCm = 10.0, kDegPerRad = 180.0 / std::numbers::pi;
constexpr std::size_t kAxesOfKind = 3;  // of a length or an angle

struct Unit {
  std::string_view name, other;
  double factor;  // from the other one
};
constexpr std::array kUnits = {Unit{"_mm", "_cm", kMmPerCm}, Unit{"_deg", "_rad", kDegPerRad}};

// "x_cm" of "x_mm", where numbers are `factor` times as large as they say; empty: no unit would explain that.
std::string renamed(const std::string& column, double factor) {
  for (const Unit& unit : kUnits)
    for (const auto& [from, to, by] :
         {std::tuple(unit.name, unit.other, unit.factor), std::tuple(unit.other, unit.name, 1.0 / unit.factor)})
      if (column.ends_with(from) && factor == by) return column.substr(0, column.size() - from.size()).append(to);
  return "";
}

// How far numbers lie from what was found, in the mean over the sessions but for the worst fifth; nothing: too few.
struct Fit {
  std::size_t count = 0;
  double off = 0.0;
};
Fit fit_of(std::span<const StatedAndFound> sessions, std::size_t column, std::size_t axis, double factor) {
  constexpr std::size_t kLeftOut = 5;
  std::vector<double> off;
  for (const auto& [stated, found] : sessions)
    if (stated[column] && found[axis])
      off.push_back(std::abs(std::abs(factor * *stated[column]) - std::abs(*found[axis])));
  std::ranges::sort(off);
  off.resize(off.size() - off.size() / kLeftOut);
  Fit fit{.count = off.size()};
  for (const double one : off) fit.off += one / static_cast<double>(off.size());
  return fit;
}

// Few sessions must leave less doubt.
bool is_far_better(const Fit& fit, const Fit& than) {
  constexpr std::size_t kSome = 4;
  constexpr double kLeast = 0.2, kTimes = 3.0, kTimesOfFew = 10.0;  // mm or degrees
  return fit.count > 1 && than.off > kLeast && than.off > (fit.count < kSome ? kTimesOfFew : kTimes) * fit.off;
}

// What a column seems to hold.
struct Reading {
  std::size_t column = 0, axis = 0;
  double factor = 1.0;
  Fit fit, as_it_is;
};

Reading reading_of(std::span<const StatedAndFound> sessions, std::size_t column, std::size_t axis) {
  Reading reading{.column = column, .axis = axis, .fit = fit_of(sessions, column, axis, 1.0)};
  reading.as_it_is = fit_of(sessions, column, column, 1.0);
  const bool is_length = column < kAxesOfKind;
  const Fit in_this_unit = reading.fit;
  for (const double factor : {is_length ? kMmPerCm : kDegPerRad, is_length ? 1.0 / kMmPerCm : 1.0 / kDegPerRad})
    if (const Fit fit = fit_of(sessions, column, axis, factor);
        is_far_better(fit, in_this_unit) && fit.off < reading.fit.off) {
      reading.fit = fit;
      reading.factor = factor;
    }
  return reading;
}

Fit sum_of(const std::vector<Reading>& readings) {
  Fit sum{.count = readings.empty() ? 0 : readings.front().fit.count};
  for (const Reading& reading : readings) {
    sum.count = std::min(sum.count, reading.fit.count);
    sum.off += reading.fit.off;
  }
  return sum;
}

// The likeliest reading of the columns of lengths, or of angles, from `first` on.
std::vector<Reading> readings_from(std::span<const StatedAndFound> sessions, std::size_t first) {
  std::vector<std::size_t> known;
  for (std::size_t axis = first; axis < first + kAxesOfKind; ++axis)
    if (fit_of(sessions, axis, axis, 1.0).count > 1) known.push_back(axis);
  const auto with = [&](const std::vector<std::size_t>& axes) {
    std::vector<Reading> readings;
    for (std::size_t n = 0; n < known.size(); ++n) readings.push_back(reading_of(sessions, known[n], axes[n]));
    return readings;
  };
  const std::vector<Reading> in_place = with(known);
  std::vector<Reading> best = in_place;
  std::vector<std::size_t> order = known;
  while (std::ranges::next_permutation(order).found)
    if (const std::vector<Reading> exchanged = with(order);
        is_far_better(sum_of(exchanged), sum_of(in_place)) && sum_of(exchanged).off < sum_of(best).off)
      best = exchanged;
  return best;
}

std::string in_words(const Reading& reading, const Columns& columns) {
  const auto& [name, unit, place] = columns[reading.column].value();
  std::string meant = reading.axis == reading.column || !columns[reading.axis] ? name : columns[reading.axis]->name;
  std::string words = name;
  if (reading.factor != 1.0) words = fmt::format("{:.3g} times {}", reading.factor, name);
  if (reading.axis != reading.column) words += fmt::format(" fits to what was found as {}", meant);
  words += fmt::format(" (off by {:.2g} instead of {:.2g})", reading.fit.off, reading.as_it_is.off);
  if (reading.factor != 1.0) meant = renamed(meant, reading.factor);
  return words + (meant.empty() ? "" : fmt::format(": if that is right, name the column {}", meant));
}

}  // namespace

Columns stated_columns(const CsvTable& table, const SixNames& names, const std::string& where) {
  Columns columns;
  for (std::size_t place = 0; place < table.columns.size(); ++place)
    for (std::size_t n = 0; n < names.size(); ++n) {
      const std::string& name = table.columns[place];
      const Unit& unit = kUnits[n / kAxesOfKind];
      const bool is_in_other = name == renamed(names[n], unit.factor);
      if (name != names[n] && !is_in_other) continue;
      if (columns[n])
        throw Error(fmt::format("{}: column \"{}\" is there already, as {}", where, name, columns[n]->name));
      columns[n] = {.name = name, .unit = is_in_other ? unit.factor : 1.0, .place = place};
    }
  return columns;
}

void check_columns(const Columns& columns, std::span<const StatedAndFound> sessions, const std::string& where) {
  std::vector<std::string> words;
  for (const std::size_t first : {std::size_t{0}, kAxesOfKind})
    for (const Reading& reading : readings_from(sessions, first))
      if (reading.factor != 1.0 || reading.axis != reading.column) words.push_back(in_words(reading, columns));
  if (!words.empty())
    throw Error(fmt::format(
        "{}: the numbers do not lie where these columns say, but fit far better to what was found in another unit or "
        "another column:\n       {}\n       Nothing is computed from them as they are",
        where, fmt::join(words, "\n       ")));
}

}  // namespace isoshift
