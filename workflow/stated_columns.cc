#include "workflow/stated_columns.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>

#include "base/error.h"

namespace isoshift {
namespace {

using Columns = std::array<std::optional<StatedColumn>, 6>;

constexpr double kMmPerCm = 10.0, kMmPerInch = 25.4, kMmPerM = 1000.0, kDegPerRad = 180.0 / std::numbers::pi,
                 kMradPerDeg = 1000.0 / kDegPerRad;
constexpr std::size_t kAxesOfKind = 3;  // of a length or an angle

struct Unit {
  std::string_view name, other;
  double factor;  // from the other one
};
constexpr std::array kUnits = {Unit{"_mm", "_cm", kMmPerCm}, Unit{"_deg", "_rad", kDegPerRad}};

bool is_length(std::size_t axis) { return axis < kAxesOfKind; }

// By what numbers in other units than the name of their column says would have to be multiplied.
std::span<const double> factors_of(std::size_t axis) {
  static constexpr std::array kOfLengths = {kMmPerCm,         1.0 / kMmPerCm, kMmPerInch,
                                            1.0 / kMmPerInch, kMmPerM,        1.0 / kMmPerM};
  static constexpr std::array kOfAngles = {kDegPerRad, 1.0 / kDegPerRad, 1.0 / kMradPerDeg, 10.0, 0.1};
  return is_length(axis) ? std::span<const double>(kOfLengths) : std::span<const double>(kOfAngles);
}

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
  for (const auto& [name, stated, found] : sessions)
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

// A reading explains what was found only if it lies far nearer to it than no shift does.
bool explains(std::span<const StatedAndFound> sessions, const Reading& reading) {
  return is_far_better(reading.fit, fit_of(sessions, reading.column, reading.axis, 0.0));
}

Reading reading_of(std::span<const StatedAndFound> sessions, std::size_t column, std::size_t axis) {
  const Reading in_this_unit{.column = column,
                             .axis = axis,
                             .fit = fit_of(sessions, column, axis, 1.0),
                             .as_it_is = fit_of(sessions, column, column, 1.0)};
  Reading reading = in_this_unit;
  if (is_length(column) != is_length(axis)) return reading;
  for (const double factor : factors_of(column)) {
    Reading other = in_this_unit;
    other.factor = factor;
    other.fit = fit_of(sessions, column, axis, factor);
    if (is_far_better(other.fit, in_this_unit.fit) && other.fit.off < reading.fit.off && explains(sessions, other))
      reading = other;
  }
  return reading;
}

// Of the columns that `readings` moves to another axis: as they are read, and where they stand.
struct Moved {
  Fit read, in_place;
};
Moved moved_in(const std::vector<Reading>& readings, const std::vector<Reading>& in_place) {
  Moved moved;
  std::size_t count = std::numeric_limits<std::size_t>::max();
  for (std::size_t n = 0; n < readings.size(); ++n) {
    if (readings[n].axis == readings[n].column) continue;
    count = std::min({count, readings[n].fit.count, in_place[n].fit.count});
    moved.read.off += readings[n].fit.off;
    moved.in_place.off += in_place[n].fit.off;
  }
  moved.read.count = moved.in_place.count = count;
  return moved;
}

double off_of(const std::vector<Reading>& readings) {
  double off = 0.0;
  for (const Reading& reading : readings) off += reading.fit.off;
  return off;
}

// The likeliest reading of all columns.
std::vector<Reading> readings_of(std::span<const StatedAndFound> sessions) {
  std::vector<std::size_t> known;
  std::array<std::array<Reading, 6>, 6> all;
  for (std::size_t axis = 0; axis < all.size(); ++axis)
    if (fit_of(sessions, axis, axis, 1.0).count > 1) known.push_back(axis);
  for (const std::size_t column : known)
    for (const std::size_t axis : known) all[column][axis] = reading_of(sessions, column, axis);
  const auto with = [&](const std::vector<std::size_t>& axes) {
    std::vector<Reading> readings;
    for (std::size_t n = 0; n < known.size(); ++n) readings.push_back(all[known[n]][axes[n]]);
    return readings;
  };
  const std::vector<Reading> in_place = with(known);
  std::vector<Reading> best = in_place;
  std::vector<std::size_t> order = known;
  while (std::ranges::next_permutation(order).found) {
    std::vector<Reading> exchanged = with(order);
    const Moved moved = moved_in(exchanged, in_place);
    if (off_of(exchanged) < off_of(best) && is_far_better(moved.read, moved.in_place) &&
        std::ranges::all_of(exchanged, [&](const Reading& reading) {
          return reading.axis == reading.column || explains(sessions, reading);
        }))
      best = std::move(exchanged);
  }
  return best;
}

// The sessions of which the lengths, or the angles, lie far nearer to what was found if they are multiplied.
std::vector<std::string> sessions_in_other_unit(std::span<const StatedAndFound> sessions, std::size_t first,
                                                double factor) {
  constexpr double kTimes = 5.0, kLeast = 1.0;  // mm or degrees, of all columns together
  std::vector<std::string> names;
  for (const StatedAndFound& session : sessions) {
    double as_it_is = 0.0, nothing = 0.0, multiplied = 0.0;
    std::size_t count = 0;
    for (std::size_t axis = first; axis < first + kAxesOfKind; ++axis) {
      if (!session.stated[axis] || !session.found[axis]) continue;
      const double stated = std::abs(*session.stated[axis]), found = std::abs(*session.found[axis]);
      ++count;
      as_it_is += std::abs(stated - found);
      multiplied += std::abs(factor * stated - found);
      nothing += found;
    }
    if (count > 1 && nothing > kLeast && kTimes * multiplied < std::min(as_it_is, nothing))
      names.push_back(session.name);
  }
  return names;
}

// Where some sessions seem to be in another unit than the others: from another console, or of another time.
std::vector<std::string> mixed_units(std::span<const StatedAndFound> sessions) {
  constexpr std::size_t kFewest = 2, kOneOf = 10, kNamed = 5;
  std::vector<std::string> words;
  for (const std::size_t first : {std::size_t{0}, kAxesOfKind})
    for (const double factor : factors_of(first)) {
      std::vector<std::string> names = sessions_in_other_unit(sessions, first, factor);
      if (names.size() < kFewest || names.size() * kOneOf < sessions.size()) continue;
      const std::size_t count = names.size();
      names.resize(std::min(count, kNamed));
      words.push_back(fmt::format("{:.3g} times the {} of {} of {} sessions: {}{}", factor,
                                  first == 0 ? "lengths" : "angles", count, sessions.size(), fmt::join(names, ", "),
                                  count > names.size() ? ", ..." : ""));
    }
  return words;
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
  for (const Reading& reading : readings_of(sessions))
    if (reading.factor != 1.0 || reading.axis != reading.column) words.push_back(in_words(reading, columns));
  if (words.empty()) words = mixed_units(sessions);
  if (!words.empty())
    throw Error(fmt::format(
        "{}: the numbers do not lie where these columns say, but fit far better to what was found in another unit or "
        "another column:\n       {}\n       Nothing is computed from them as they are",
        where, fmt::join(words, "\n       ")));
}

}  // namespace isoshift
