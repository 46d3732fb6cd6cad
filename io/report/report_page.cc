#include "io/report/report_page.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "base/option_name.h"
#include "geometry/rotation.h"
#include "io/report/canvas.h"
#include "io/report/drawings.h"
#include "io/report/moved_bodies.h"
#include "io/report/report_sections.h"
#include "io/report/rounding.h"
#include "setup/shown_shift.h"

namespace isoshift {
namespace {

constexpr std::array<std::size_t, 3> kRotationAxis = {2, 0, 1};  // of yaw, pitch and roll

// The two senses of an axis in words, for positive and negative values.
struct Sense {
  const char* positive;
  const char* negative;
};

constexpr Sense kLateral = {"to the right, seen facing the gantry", "to the left, seen facing the gantry"};
constexpr Sense kLongitudinal = {"toward the gantry", "away from the gantry"};
constexpr Sense kVertical = {"up", "down"};
constexpr Sense kYaw = {"counter-clockwise, seen from above", "clockwise, seen from above"};
constexpr Sense kPitch = {"gantry end up", "gantry end down"};
constexpr Sense kRoll = {"right side down, seen facing the gantry", "left side down, seen facing the gantry"};

// Where a step of the table top goes in the room, strongest first: "toward the gantry and to the left".
std::string room_words(const Eigen::Vector3d& direction) {
  constexpr double kWeak = 0.3;
  if (std::abs(direction.z()) > kWeak) return direction.z() > 0.0 ? kVertical.positive : kVertical.negative;
  const bool has_x = std::abs(direction.x()) > kWeak, has_y = std::abs(direction.y()) > kWeak;
  const char* along_y = direction.y() > 0.0 ? kLongitudinal.positive : kLongitudinal.negative;
  if (!has_x) return along_y;
  const char* along_x = direction.x() > 0.0 ? kLateral.positive : kLateral.negative;
  return has_y ? fmt::format("{} and {}", along_y, along_x) : along_x;
}

std::optional<double> twice(const std::optional<double>& sigma) {
  return sigma ? std::optional(2.0 * *sigma) : std::nullopt;
}

Quantity quantity(std::string name, const std::optional<double>& value, std::string unit, std::string text,
                  std::string plus_minus, const Sense& sense) {
  if (!value) return {.name = std::move(name), .value = kNotDetermined, .unit = std::move(unit), .is_number = false};
  Quantity result{
      .name = std::move(name), .value = std::move(text), .unit = std::move(unit), .plus_minus = std::move(plus_minus)};
  if (!is_zero(result.value)) result.words = *value > 0.0 ? sense.positive : sense.negative;
  return result;
}

Quantity length(std::string name, const std::optional<double>& mm, const std::optional<double>& sigma_mm,
                LengthUnit unit, const Sense& sense) {
  return quantity(std::move(name), mm, name_of(unit), mm ? rounded_length(*mm, unit, twice(sigma_mm)) : "",
                  sigma_mm ? rounded_up_length(2.0 * *sigma_mm, unit) : "", sense);
}

Quantity angle(std::string name, double deg, const std::optional<double>& sigma_deg, const Sense& sense) {
  return quantity(std::move(name), deg, "deg", rounded(deg, twice(sigma_deg)),
                  sigma_deg ? rounded_up(2.0 * *sigma_deg) : "", sense);
}

Quantity taken_as_zero(const std::string& name) {
  return {.name = name,
          .value = "taken as 0",
          .unit = "deg",
          .words = "only translations were searched",
          .is_number = false};
}

std::vector<std::string> all_printable(const std::vector<std::string>& texts) {
  std::vector<std::string> result;
  std::ranges::transform(texts, std::back_inserter(result), &printable);
  return result;
}

// DA for people: 2026-03-01.
std::string day(const std::string& date) {
  if (date.size() != 8) return date;
  return date.substr(0, 4) + "-" + date.substr(4, 2) + "-" + date.substr(6, 2);
}

std::string joined(const std::vector<std::string>& parts, const char* separator = ", ") {
  std::string text;
  for (const std::string& part : parts)
    if (!part.empty()) text += (text.empty() ? "" : separator) + part;
  return text;
}

std::string described_view(const SetupResult::View& view) {
  return joined({printable(view.label),
                 view.gantry_deg ? fmt::format("gantry {:.1f} deg", *view.gantry_deg) : "by its matrix",
                 view.is_megavoltage ? "MV" : "kV", printable(view.acquired),
                 view.origin.empty() ? "" : "angles " + printable(view.origin)});
}

// Empty where the pose was searched from the planned one.
std::string start_words(const SetupResult& report) {
  if (!report.start) return report.is_searched ? "" : "as planned, NOT SEARCHED";
  const Start& start = *report.start;
  const std::string from =
      start.set_by.empty() ? "taken from " + printable(start.file) : "set by hand by " + printable(start.set_by);
  return report.is_searched ? "searched from a start " + from : from + ", NOT SEARCHED";
}

std::vector<ReportPage::Row> who(const SetupResult& report, const std::string& bent) {
  const Identity& patient = report.identity;
  std::vector<ReportPage::Row> rows;
  rows.push_back(
      {"Patient",
       joined({name_for_people(patient.patient_name), "ID " + printable(patient.patient_id),
               patient.patient_birth_date.empty() ? "" : "born " + day(printable(patient.patient_birth_date)),
               printable(patient.patient_sex)})});
  if (report.target)
    rows.push_back(
        {"Target",
         fmt::format("{} ({}){}", printable(report.target->name), report.target->chosen_by,
                     report.target->surrogate.empty() ? "" : "; seen by: " + printable(report.target->surrogate))});
  if (!bent.empty()) rows.push_back({kBent, bent});
  rows.push_back({"Plan", report.plan_uid.empty()
                              ? "none; isocenter given by hand"
                              : joined({printable(report.plan_label), printable(report.plan_approval)})});
  rows.push_back({"Position", fmt::format("{}, couch {:.1f} deg at imaging", report.patient_position,
                                          deg_from_rad(report.table.yaw_rad()))});
  for (std::size_t n = 0; n < report.views.size(); ++n)
    rows.push_back({fmt::format("X-ray {}", n + 1), described_view(report.views[n])});
  if (const std::string words = start_words(report); !words.empty()) rows.push_back({"Pose", words});
  if (report.machine) rows.push_back({"Machine", fmt::format("profile \"{}\"", printable(report.machine->name))});
  if (report.site) rows.push_back({"Site", printable(report.site->name)});
  rows.push_back({"Made on", report.made_on});
  return rows;
}

std::string action_words(const SetupResult& report, const ShownShift& shown) {
  const std::string level = report.site && !report.site->anatomy.empty()
                                ? fmt::format("the action level \"{}\"", printable(report.site->anatomy))
                                : "the action level";
  switch (shown.decision.action) {
    case Action::kWithin: return "The shift is within " + level;
    case Action::kExceeds: return "The shift exceeds " + level;
    case Action::kUnset: break;
  }
  if (shown.withheld) return "No action level applies: the result was rejected";
  if (!report.site) return "No action level: no site file was given (" + option("site", "FILE") + ")";
  return report.site->level ? "The action level cannot be judged: a component was not determined"
                            : "No action level: the site file has none for this anatomy";
}

std::vector<Quantity> couch_rows(const ShownShift& shown, const SetupResult& report, LengthUnit unit) {
  const auto sigma_of = [&](int axis) { return shown.sigma_deg[static_cast<std::size_t>(axis)]; };
  const double yaw = report.table.yaw_rad();
  std::vector<Quantity> rows = {
      length("Lateral", shown.applied_mm[0], shown.couch_sigma_mm[0], unit, kLateral),
      length("Longitudinal", shown.applied_mm[1], shown.couch_sigma_mm[1], unit, kLongitudinal),
      length("Vertical", shown.applied_mm[2], shown.couch_sigma_mm[2], unit, kVertical)};
  for (int axis = 0; axis < 3; ++axis)
    if (Quantity& row = rows[static_cast<std::size_t>(axis)]; !row.words.empty())
      row.words = room_words(rotation_z(yaw).col(axis) * *shown.applied_mm[static_cast<std::size_t>(axis)] /
                             std::abs(*shown.applied_mm[static_cast<std::size_t>(axis)]));
  // Its ends and sides have these names with the couch straight.
  const bool is_turned = std::abs(std::sin(yaw)) > 0.3 || std::cos(yaw) < 0.0;
  constexpr Sense kTurnedPitch = {"end up that is at the gantry at couch angle 0",
                                  "end down that is at the gantry at couch angle 0"};
  constexpr Sense kTurnedRoll = {"side down that is the right one at couch angle 0",
                                 "side down that is the left one at couch angle 0"};
  rows.push_back(angle("Yaw", shown.couch_deg[0], sigma_of(2), kYaw));
  rows.push_back(angle("Pitch", shown.couch_deg[1], sigma_of(0), is_turned ? kTurnedPitch : kPitch));
  rows.push_back(angle("Roll", shown.couch_deg[2], sigma_of(1), is_turned ? kTurnedRoll : kRoll));
  for (std::size_t n = 0; n < 3; ++n) {
    Quantity& row = rows[3 + n];
    if (report.translation_only)
      row = taken_as_zero(row.name);
    else if (!shown.can_rotate[n])
      row = {.name = row.name,
             .value = "not applied",
             .unit = "deg",
             .words = fmt::format("this couch has {} degrees of freedom", static_cast<int>(report.site->couch_dof)),
             .is_number = false};
  }
  return rows;
}

std::string target_words(const ShownShift& shown, const TableAngles& table) {
  const std::array names = {"yaw", "pitch", "roll"};
  const std::array at_imaging_deg = {deg_from_rad(wrapped_rad(table.yaw_rad())), deg_from_rad(table.pitch_rad),
                                     deg_from_rad(table.roll_rad)};
  std::vector<std::string> parts;
  parts.reserve(names.size());
  for (std::size_t n = 0; n < 3; ++n)
    parts.push_back(fmt::format("{} {}", names[n],
                                shown.can_rotate[n]
                                    ? rounded(shown.couch_target_deg[n], twice(shown.sigma_deg[kRotationAxis[n]]))
                                    : rounded(at_imaging_deg[n])));
  return fmt::format("IEC table angles after the move: {} deg", joined(parts));
}

// The shift as a vendor's couch shows it: the change, and from where to where if the read-outs at imaging are known.
ReportPage::Display display_of(const SetupResult& report, const ShownShift& shown, LengthUnit unit) {
  const ValidatedScale& scale = *report.site->couch_scale;
  ReportPage::Display display{.title = fmt::format("On the couch's display: {} scale, validated by {} on {}",
                                                   to_string(scale.scale), printable(scale.validated_by),
                                                   scale.validated_on)};
  const std::array<int, 4> signs = signs_on_scale(scale.scale);
  constexpr std::array kNames = {"Lateral", "Longitudinal", "Vertical"};
  // What a display shows has one decimal: rounded before it is counted its way.
  const auto to_tenth = [](double value) { return std::round(10.0 * value) / 10.0; };
  CouchReadOut before, after;
  before.angle_deg = to_tenth(deg_from_rad(report.table.support_rad));
  after.angle_deg = to_tenth(before.angle_deg + (shown.can_rotate[0] ? shown.couch_deg[0] : 0.0));
  if (report.table_position_mm) before.position_mm = report.table_position_mm->unaryExpr(to_tenth);
  for (int axis = 0; axis < 3; ++axis)
    after.position_mm[axis] =
        to_tenth(before.position_mm[axis] + shown.applied_mm[static_cast<std::size_t>(axis)].value_or(0.0));
  const CouchReadOut from = on_scale(scale.scale, before), to = on_scale(scale.scale, after);
  const auto is_precise = [](const std::optional<double>& sigma) { return !sigma || 2.0 * *sigma <= 1.0; };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto& mm = shown.applied_mm[axis];
    const std::optional<double> change = mm ? std::optional(signs[axis] * *mm) : std::nullopt;
    Quantity row = length(kNames[axis], change, shown.couch_sigma_mm[axis], unit, {"", ""});
    if (mm && report.table_position_mm && is_precise(shown.couch_sigma_mm[axis])) {
      const auto n = static_cast<Eigen::Index>(axis);
      row.words = fmt::format("from {} to {} {}", unsigned_length(from.position_mm[n], unit),
                              unsigned_length(to.position_mm[n], unit), name_of(unit));
    }
    display.rows.push_back(std::move(row));
  }
  if (shown.can_rotate[0] && !report.translation_only) {
    Quantity row = angle("Yaw", signs[3] * shown.couch_deg[0], shown.sigma_deg[2], {"", ""});
    if (is_precise(shown.sigma_deg[2]))
      row.words = fmt::format("from {:.1f} to {:.1f} deg", from.angle_deg, to.angle_deg);
    display.rows.push_back(std::move(row));
  }
  return display;
}

void put_shift(const SetupResult& report, const ShownShift& shown, LengthUnit unit, ReportPage& page) {
  page.couch = couch_rows(shown, report, unit);
  page.couch_order = "Translate, then rotate about the isocenter";
  page.couch_target = target_words(shown, report.table);
  page.setup_error = {length("x", shown.setup_error_mm[0], shown.sigma_mm[0], unit, kLateral),
                      length("y", shown.setup_error_mm[1], shown.sigma_mm[1], unit, kLongitudinal),
                      length("z", shown.setup_error_mm[2], shown.sigma_mm[2], unit, kVertical),
                      angle("about x", shown.setup_error_deg[0], shown.sigma_deg[0], kPitch),
                      angle("about y", shown.setup_error_deg[1], shown.sigma_deg[1], kRoll),
                      angle("about z", shown.setup_error_deg[2], shown.sigma_deg[2], kYaw)};
  if (report.translation_only)
    for (std::size_t n = 3; n < 6; ++n) page.setup_error[n] = taken_as_zero(page.setup_error[n].name);
  if (report.unobservable_room.empty()) {
    std::optional<double> two_sigma_mm;
    if (report.uncertainty) two_sigma_mm = 2.0 * report.uncertainty->sigma_translation_mm().maxCoeff();
    const std::string text = rounded_length(report.setup_error.translation().norm(), unit, two_sigma_mm);
    page.setup_error_length =
        fmt::format("Length of the translation {} {}", text.substr(text.starts_with('+') ? 1 : 0), name_of(unit));
  }
  if (report.site && report.site->couch_scale) page.display = display_of(report, shown, unit);
  if (std::ranges::all_of(shown.left_over, [](const auto& left) { return left.mm.norm() < 1e-6; })) return;
  page.left_over_words = "What remains after that, IEC 61217 fixed axes";
  for (const ShownShift::LeftOver& left : shown.left_over) {
    ReportPage::LeftOver row{.at = printable(left.at), .unit = name_of(unit)};
    for (std::size_t axis = 0; axis < 3; ++axis)
      row.components[axis] = rounded_length(left.mm[static_cast<Eigen::Index>(axis)], unit);
    row.length = unsigned_length(left.mm.norm(), unit);
    page.left_over.push_back(std::move(row));
  }
}

const char* meaning(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAccepted: return "the checks of isoshift found nothing wrong";
    case Verdict::kReview: return "a person must judge it, for these reasons";
    case Verdict::kRejected: return "do not use it, for these reasons";
  }
  return "";
}

std::string picture_words(const SetupResult& report) {
  std::string words =
      "Both: X-ray magenta, DRR green, gray where they match. Cross: isocenter. Dashed: compared field.";
  const auto has_structures = [](const SetupResult::View& view) { return !view.picture.structures.empty(); };
  if (std::ranges::any_of(report.views, has_structures)) words += " Orange: structures.";
  const auto has_squares = [](const SetupResult::View& view) { return !mismatch_marks(view).squares.empty(); };
  if (std::ranges::any_of(report.views, has_squares)) words += " Yellow squares: parts that match elsewhere.";
  const auto has_arrows = [](const SetupResult::View& view) { return !view.picture.moved.empty(); };
  if (std::ranges::any_of(report.views, has_arrows))
    words += fmt::format(" Yellow arrows: bones that lie off once the target is right, {:.0f} times as long.",
                         kMotionMagnified);
  return words;
}

}  // namespace

std::string upper_case(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return result;
}

std::string name_for_people(const std::string& person_name) {
  const auto group = [&](std::string_view text) {
    std::string shown;
    for (const char c : printable(text)) shown += c == '^' ? ' ' : c;
    std::string once;  // empty components leave no gaps
    for (const char c : shown)
      if (c != ' ' || (!once.empty() && once.back() != ' ')) once += c;
    if (once.ends_with(' ')) once.pop_back();
    return once;
  };
  const std::string_view all = person_name;
  const auto first_end = all.find('=');
  std::string name = group(all.substr(0, first_end));
  if (first_end == std::string_view::npos) return name;
  const std::string_view rest = all.substr(first_end + 1);
  const std::string ideographic = group(rest.substr(0, rest.find('=')));
  if (ideographic.empty()) return name;
  return name.empty() ? ideographic : fmt::format("{} ({})", name, ideographic);
}

ReportPage report_page(const SetupResult& report) {
  const ShownShift shown = shown_shift(report);
  const LengthUnit unit = report.site ? report.site->length_unit : LengthUnit::kMm;
  ReportPage page;
  page.title = "Patient setup shift";
  page.program = fmt::format("isoshift {} ({})", report.version, report.commit);
  page.disclaimer = kDisclaimer;
  page.who = who(report, bent_words(shown, unit));
  page.verdict = report.verdict();
  page.verdict_words = fmt::format("{}: {}", upper_case(to_string(report.verdict())), meaning(report.verdict()));
  page.reasons = all_printable(report.reasons());
  page.action = shown.decision.action;
  page.action_words = action_words(report, shown);
  page.action_reasons = shown.decision.reasons;
  page.withheld = shown.withheld;
  if (!shown.withheld) put_shift(report, shown, unit, page);
  page.picture_words = picture_words(report);
  page.conventions = {
      "IEC 61217: facing the gantry, x to the right, y toward the gantry, z up; the origin is the isocenter.",
      "Setup error: where the patient lies. Anatomy planned at p is found at R p + t, with R = Rz Rx Ry; couch: what "
      "undoes it, "
      "along the table top's axes at imaging. Angles of the couch are changes of its read-outs.",
      "Shift and setup error are rounded once, to 0.1 mm and 0.1 deg, or to 1 where two sigma exceeds 1; +/- is two "
      "sigma. "
      "result.json has full precision."};
  page.warnings = all_printable(report.warnings);
  page.overrides = all_printable(report.overrides);
  page.left_aside = all_printable(report.left_aside);
  page.details = report_sections(report, shown, unit, page);
  return page;
}

}  // namespace isoshift
