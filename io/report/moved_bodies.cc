#include "io/report/moved_bodies.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/report/canvas.h"
#include "io/report/rounding.h"

namespace isoshift {
namespace {

using Moved = ShownShift::Moved;

// Less than this is not told on the first page.
constexpr double kLeastMm = 2.0, kLeastDeg = 2.0;

// What each axis of the patient (left, back, head) means, for positive and negative components. A bone is tilted the
// way its end toward the head goes, and turned the way its front goes.
using AxisWords = std::array<std::array<const char*, 2>, 3>;
constexpr AxisWords kWays = {
    {{"to the left", "to the right"}, {"to the back", "to the front"}, {"toward the head", "toward the feet"}}};
constexpr AxisWords kTurns = {{{"tilted forward", "tilted backward"},
                               {"tilted to the left", "tilted to the right"},
                               {"turned to the left", "turned to the right"}}};

// Of the strongest component.
std::string strongest(const std::optional<Eigen::Vector3d>& unit_vector, const AxisWords& words) {
  if (!unit_vector) return "";
  Eigen::Index axis = 0;
  unit_vector->cwiseAbs().maxCoeff(&axis);
  return words[static_cast<std::size_t>(axis)][(*unit_vector)[axis] > 0.0 ? 0 : 1];
}

std::string length_words(const Moved& body, LengthUnit unit) {
  return fmt::format("{} {}", unsigned_length(*body.mm, unit, body.two_sigma_mm), name_of(unit));
}

std::string angle_words(const Moved& body) {
  const std::string text = rounded(*body.deg);
  return (text.starts_with('+') ? text.substr(1) : text) + " deg";
}

// "Vertebra 3 toward the head" is a name of its own.
std::string the(const std::string& name) {
  constexpr std::string_view kNumbered = "vertebra ";
  const bool is_numbered = name.starts_with(kNumbered) && name.find_first_of("0123456789") == kNumbered.size();
  return (is_numbered ? "" : "the ") + printable(name);
}

bool is_plural(const std::string& name) { return name.find("bones") != std::string::npos; }

std::string lies_off(const Moved& body, LengthUnit unit) {
  const std::string way = strongest(body.direction_patient, kWays);
  return fmt::format("{} {} off{}", is_plural(body.name) ? "lie" : "lies", length_words(body, unit),
                     way.empty() ? "" : fmt::format(" ({})", way));
}

std::string is_turned(const Moved& body) {
  const std::string turn = strongest(body.axis_patient, kTurns);
  return fmt::format("{} {} {}", is_plural(body.name) ? "are" : "is", turn.empty() ? "turned" : turn,
                     "by " + angle_words(body));
}

std::string value_of(const Moved& body, LengthUnit unit) {
  std::string words = kNotDetermined;
  if (body.is_determined) {
    words = fmt::format("{} +/- {} {}", unsigned_length(*body.mm, unit, body.two_sigma_mm),
                        rounded_up_length(*body.two_sigma_mm, unit), name_of(unit));
    const std::string way = strongest(body.direction_patient, kWays), turn = strongest(body.axis_patient, kTurns);
    if (!way.empty() && !is_zero(unsigned_length(*body.mm, unit, body.two_sigma_mm))) words += ", " + way;
    words += "; " + angle_words(body);
    if (!turn.empty() && !is_zero(angle_words(body))) words += ", " + turn;
  }
  if (body.carries_target >= 0.005) words += fmt::format("; carries the target {:.0f} %", 100.0 * body.carries_target);
  if (body.breathes) words += "; breathes";
  return words;
}

std::string structure_words(const StructureMotion& structure, LengthUnit unit) {
  if (!structure.is_determined) return kNotDetermined;
  return fmt::format("its center lies {} {} off, its surface {} {} at most, if it goes with the bones near it",
                     unsigned_length(structure.displacement_mm.norm(), unit), name_of(unit),
                     unsigned_length(structure.most_mm, unit), name_of(unit));
}

// How the spine bends on one side of the target: the way its last vertebra that is determined is turned. Empty: not
// told.
std::string spine_words(const std::vector<Moved>& moved, int side) {
  const Moved* last = nullptr;
  for (const Moved& body : moved)
    if (body.is_determined && body.vertebra && *body.vertebra * side > 0 &&
        (last == nullptr || *body.vertebra * side > *last->vertebra * side))
      last = &body;
  if (last == nullptr || !(*last->deg > kLeastDeg)) return "";
  const int count = std::abs(*last->vertebra);
  return fmt::format("toward the {} the spine {} over {} {}", side > 0 ? "head" : "feet", is_turned(*last), count,
                     count == 1 ? "vertebra" : "vertebrae");
}

}  // namespace

std::string bent_words(const ShownShift& shown, LengthUnit unit) {
  if (shown.moved.empty()) return "";
  // What breathes lies elsewhere in every view: it says little about how the patient lies.
  const auto counts = [](const Moved& body) { return body.is_determined && !body.breathes; };
  const Moved *farthest = nullptr, *most_turned = nullptr;
  for (const Moved& body : shown.moved) {
    if (!counts(body)) continue;
    if (*body.mm > kLeastMm && (farthest == nullptr || *body.mm > *farthest->mm)) farthest = &body;
    if (*body.deg > kLeastDeg && (most_turned == nullptr || *body.deg > *most_turned->deg)) most_turned = &body;
  }
  // What carries the target cannot have moved against it by much, and says nothing of the others.
  const auto is_other = [&](const Moved& body) { return counts(body) && !(body.carries_target > 0.0); };
  if (std::ranges::none_of(shown.moved, is_other))
    return "What the other bones did against the target is not determined";
  const std::string once = "Once the target is right, ";
  const std::string headward = spine_words(shown.moved, 1), footward = spine_words(shown.moved, -1);
  if (!headward.empty() || !footward.empty())
    return once + headward + (headward.empty() || footward.empty() ? "" : ", ") + footward;
  if (farthest == nullptr && most_turned == nullptr)
    return fmt::format("{}no bone that is determined lies more than {} {} off or is turned by more than {:.0f} deg",
                       once, unsigned_length(kLeastMm, unit), name_of(unit), kLeastDeg);
  if (farthest == most_turned)
    return fmt::format("{}{} {} and {}", once, the(farthest->name), lies_off(*farthest, unit), is_turned(*farthest));
  std::string words = once;
  if (farthest != nullptr) words += fmt::format("{} {}", the(farthest->name), lies_off(*farthest, unit));
  if (most_turned != nullptr)
    words += fmt::format("{}{} {} against it", farthest != nullptr ? "; " : "", the(most_turned->name),
                         is_turned(*most_turned));
  return words;
}

ReportPage::Section moved_section(const ShownShift& shown, const std::vector<StructureMotion>& structures,
                                  LengthUnit unit) {
  ReportPage::Section section{.title = kMovedTitle};
  section.rows.push_back(
      {"Bone", "how far its center lies off once the target is right, +/- two sigma; how it is turned"});
  for (const Moved& body : shown.moved) section.rows.push_back({printable(body.name), value_of(body, unit)});
  for (const StructureMotion& structure : structures)
    section.rows.push_back({"Structure " + printable(structure.name), structure_words(structure, unit)});
  section.rows.push_back({"Arrows in the pictures",
                          fmt::format("what lies off by 1 mm and more, {:.0f} times as long", kMotionMagnified)});
  return section;
}

}  // namespace isoshift
