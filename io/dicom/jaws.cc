#include "io/dicom/jaws.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>
#include <utility>

namespace isoshift {
namespace {

constexpr double kOpenMm = 2000.0;  // beyond any receptor
constexpr double kClosedMm = 0.5;   // leaves that are no farther apart are closed

std::string rounded_mm(double value) { return fmt::format("{:.6g}", value); }

// Positions come in two halves: first of all leaves at the lower side, then of those opposite.
struct Positions {
  std::vector<double> values_mm;
  std::size_t pairs() const { return values_mm.size() / 2; }
  JawOpening pair(std::size_t n) const { return {values_mm[n], values_mm[pairs() + n]}; }
};

// Why positions cannot be used; empty: they can.
std::string problem_of(const Positions& positions, std::size_t expected_pairs) {
  if (positions.values_mm.size() != 2 * expected_pairs)
    return fmt::format("{} has {} values, expected {}", described(DCM_LeafJawPositions), positions.values_mm.size(),
                       2 * expected_pairs);
  for (std::size_t n = 0; n < expected_pairs; ++n) {
    const JawOpening pair = positions.pair(n);
    if (pair.to_mm < pair.from_mm)
      return fmt::format("{} has its ends swapped: pair {} goes from {} to {} mm", described(DCM_LeafJawPositions),
                         n + 1, rounded_mm(pair.from_mm), rounded_mm(pair.to_mm));
  }
  return {};
}

// Why boundaries cannot be used; empty: they can.
std::string problem_of(const std::vector<double>& boundaries_mm, const std::optional<double>& pairs) {
  if (boundaries_mm.size() < 2) return fmt::format("{} is missing", described(DCM_LeafPositionBoundaries));
  if (pairs && *pairs != static_cast<double>(boundaries_mm.size() - 1))
    return fmt::format("{} has {} values, expected {} for {} {}", described(DCM_LeafPositionBoundaries),
                       boundaries_mm.size(), *pairs + 1, described(DCM_NumberOfLeafJawPairs), *pairs);
  if (std::ranges::adjacent_find(boundaries_mm, std::greater_equal()) != boundaries_mm.end())
    return fmt::format("{} does not rise from value to value", described(DCM_LeafPositionBoundaries));
  return {};
}

// The item that says what the device of this type is like.
const DicomItem* device_of(const std::vector<DicomItem>& devices, const std::string& type) {
  const auto device = std::ranges::find_if(
      devices, [&](const DicomItem& item) { return item.text(DCM_RTBeamLimitingDeviceType) == type; });
  return device == devices.end() ? nullptr : &*device;
}

// Why leaves are left out; empty: they were added.
std::string add_leaves(const Positions& positions, const DicomItem* device, bool along_x, JawOpenings& openings) {
  if (!openings.leaves.empty()) return "a second device with leaves is not supported";
  const std::vector<double> boundaries_mm =
      device ? device->numbers(DCM_LeafPositionBoundaries) : std::vector<double>();
  std::string problem =
      problem_of(boundaries_mm, device ? device->number(DCM_NumberOfLeafJawPairs) : std::optional<double>());
  if (problem.empty()) problem = problem_of(positions, boundaries_mm.size() - 1);
  if (!problem.empty()) return problem;
  openings.leaves_move_along_x = along_x;
  for (std::size_t n = 0; n < positions.pairs(); ++n)
    openings.leaves.push_back(
        {.opening = positions.pair(n), .lower_mm = boundaries_mm[n], .upper_mm = boundaries_mm[n + 1]});
  return {};
}

// Adds what an item says. Why it is left out; empty: it was added.
std::string add_device(const DicomItem& item, const std::string& type, const std::vector<DicomItem>& devices,
                       JawOpenings& openings) {
  const Positions positions{item.numbers(DCM_LeafJawPositions)};
  if (positions.values_mm.empty()) return fmt::format("{} is missing", described(DCM_LeafJawPositions));
  if (type == "MLCX" || type == "MLCY")
    return add_leaves(positions, device_of(devices, type), type == "MLCX", openings);
  if (type != "X" && type != "Y" && type != "ASYMX" && type != "ASYMY")
    return fmt::format("{} is \"{}\", expected X, Y, ASYMX, ASYMY, MLCX or MLCY",
                       described(DCM_RTBeamLimitingDeviceType), type);
  if (std::string problem = problem_of(positions, 1); !problem.empty()) return problem;
  // A machine with two pairs of jaws along one axis is as open as both of them.
  std::optional<JawOpening>& axis = type.ends_with('X') ? openings.x : openings.y;
  const JawOpening opening = positions.pair(0);
  axis = axis ? JawOpening{std::max(axis->from_mm, opening.from_mm), std::min(axis->to_mm, opening.to_mm)} : opening;
  return {};
}

JawOpening cut(const JawOpening& opening, const JawOpening& by) {
  return {std::clamp(opening.from_mm, by.from_mm, by.to_mm), std::clamp(opening.to_mm, by.from_mm, by.to_mm)};
}

double width_mm(const LeafPair& pair) { return pair.opening.to_mm - pair.opening.from_mm; }

// Leaves as far as the jaws let them be seen; closed ones at the ends are left out.
std::vector<LeafPair> open_leaves(const JawOpenings& openings, const JawOpening& along, const JawOpening& across) {
  std::vector<LeafPair> seen;
  for (LeafPair pair : openings.leaves) {
    pair.opening = cut(pair.opening, along);
    pair.lower_mm = std::max(pair.lower_mm, across.from_mm);
    pair.upper_mm = std::min(pair.upper_mm, across.to_mm);
    if (pair.lower_mm >= pair.upper_mm || (seen.empty() && width_mm(pair) <= kClosedMm)) continue;
    seen.push_back(pair);
  }
  while (!seen.empty() && width_mm(seen.back()) <= kClosedMm) seen.pop_back();
  return seen;
}

}  // namespace

JawOpenings read_jaws(const std::vector<DicomItem>& positions, const std::vector<DicomItem>& devices) {
  JawOpenings openings;
  for (const DicomItem& item : positions) {
    const std::string type = item.text(DCM_RTBeamLimitingDeviceType).value_or("");
    const std::string problem = add_device(item, type, devices, openings);
    if (!problem.empty())
      openings.problems.push_back(
          fmt::format("{}: {} is left out: {}", item.where(), type.empty() ? "a beam limiting device" : type, problem));
  }
  for (const auto& [axis, jaws] : {std::pair("X", openings.x), std::pair("Y", openings.y)})
    if (jaws && jaws->to_mm <= jaws->from_mm)
      openings.problems.push_back(fmt::format("{}: the jaws along {} are closed ({} to {} mm), so no field is drawn",
                                              positions.front().where(), axis, rounded_mm(jaws->from_mm),
                                              rounded_mm(jaws->to_mm)));
  return openings;
}

std::vector<Eigen::Vector2d> outline_of(const JawOpenings& openings) {
  if (openings.is_empty()) return {};
  const JawOpening open{-kOpenMm, kOpenMm}, x = openings.x.value_or(open), y = openings.y.value_or(open);
  if (!(x.to_mm > x.from_mm) || !(y.to_mm > y.from_mm)) return {};
  if (openings.leaves.empty())
    return {{x.from_mm, y.from_mm}, {x.to_mm, y.from_mm}, {x.to_mm, y.to_mm}, {x.from_mm, y.to_mm}};
  const bool along_x = openings.leaves_move_along_x;
  const std::vector<LeafPair> leaves = open_leaves(openings, along_x ? x : y, along_x ? y : x);
  // Up along the lower ends of the leaves, and back along those opposite. Leaves in line make one side.
  std::vector<Eigen::Vector2d> outline;
  const auto add = [&](double along_mm, double across_mm) {
    const Eigen::Vector2d point = along_x ? Eigen::Vector2d(along_mm, across_mm) : Eigen::Vector2d(across_mm, along_mm);
    const int along = along_x ? 0 : 1;
    const std::size_t count = outline.size();
    if (count >= 2 && outline[count - 1][along] == along_mm && outline[count - 2][along] == along_mm)
      outline.back() = point;
    else if (outline.empty() || outline.back() != point)
      outline.push_back(point);
  };
  for (const LeafPair& pair : leaves) {
    add(pair.opening.from_mm, pair.lower_mm);
    add(pair.opening.from_mm, pair.upper_mm);
  }
  for (auto pair = leaves.rbegin(); pair != leaves.rend(); ++pair) {
    add(pair->opening.to_mm, pair->upper_mm);
    add(pair->opening.to_mm, pair->lower_mm);
  }
  return outline;
}

std::string described(const JawOpenings& openings) {
  std::vector<std::string> parts;
  const auto add = [&](const char* axis, const std::optional<JawOpening>& jaw) {
    if (jaw) parts.push_back(fmt::format("{} {} to {} mm", axis, rounded_mm(jaw->from_mm), rounded_mm(jaw->to_mm)));
  };
  add("X", openings.x);
  add("Y", openings.y);
  if (!openings.leaves.empty())
    parts.push_back(fmt::format("{} pairs of leaves along {}, open by up to {} mm", openings.leaves.size(),
                                openings.leaves_move_along_x ? "X" : "Y",
                                rounded_mm(std::ranges::max(openings.leaves, {}, width_mm).opening.to_mm -
                                           std::ranges::max(openings.leaves, {}, width_mm).opening.from_mm)));
  return parts.empty() ? "not declared" : fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace isoshift
