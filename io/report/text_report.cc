#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "geometry/rotation.h"
#include "io/report/setup_report.h"
#include "io/version.h"

namespace isoshift {
namespace {

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

// "  x              -4.3 +/- 0.1 mm   to the left, seen facing the gantry"; the uncertainty is two sigma.
std::string row(std::string_view name, const std::optional<double>& value, std::string_view unit, const Sense& sense,
                const std::optional<double>& sigma = std::nullopt) {
  if (!value) return fmt::format("  {:<14} not determined\n", name);
  const std::string number = rounded(*value);
  const char* words = number == "0.0" ? "" : *value > 0.0 ? sense.positive : sense.negative;
  const std::string uncertain = sigma ? fmt::format(" +/- {}", rounded_up(2.0 * *sigma)) : "";
  const std::string line = fmt::format("  {:<14} {:>6}{} {:<4} {}", name, number, uncertain, unit, words);
  return line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
}

std::string couch_rows(const ShownShift& shown) {
  return row("Lateral", shown.couch_mm[0], "mm", kLateral) +
         row("Longitudinal", shown.couch_mm[1], "mm", kLongitudinal) +
         row("Vertical", shown.couch_mm[2], "mm", kVertical) + row("Yaw", shown.couch_deg[0], "deg", kYaw) +
         row("Pitch", shown.couch_deg[1], "deg", kPitch) + row("Roll", shown.couch_deg[2], "deg", kRoll);
}

std::string list(std::string_view title, const std::vector<std::string>& lines) {
  if (lines.empty()) return "";
  return fmt::format("\n{}\n  - {}\n", title, fmt::join(lines, "\n  - "));
}

// Text from files, on one line and without control characters.
std::string plain(std::string text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = ' ';
  return text;
}

std::string upper(std::string_view word) {
  std::string text(word);
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

}  // namespace

std::string text_report(const SetupReport& report) {
  const ShownShift shown = shown_shift(report);
  std::string text = fmt::format(
      "PATIENT SETUP SHIFT                                   isoshift {} ({})\n"
      "Not for clinical use unless validated by the site.\n\n"
      "Patient      {}  (ID {})\n"
      "Plan         {}\n"
      "Position     {}, couch {:.1f} deg at imaging\n"
      "Isocenter    ({:.2f}) mm, patient coordinates of the CT\n"
      "X-rays       ",
      kVersion, kCommit, plain(report.patient_name), plain(report.patient_id),
      report.plan_uid.empty() ? "none; isocenter given by hand" : plain(report.plan_label), report.patient_position,
      deg_from_rad(report.table.support_rad), fmt::join(report.isocenter_patient_mm, ", "));
  for (std::size_t n = 0; n < report.views.size(); ++n)
    text += fmt::format(
        "{}{} ({})", n ? ", " : "", plain(report.views[n].label),
        report.views[n].gantry_deg ? fmt::format("gantry {:.1f} deg", *report.views[n].gantry_deg) : "by its matrix");
  if (report.machine)
    text +=
        fmt::format("\nMachine      profile \"{}\", SHA-256 {}", plain(report.machine->name), report.machine->sha256);

  text += fmt::format("\n\nVERDICT      {}\n", upper(to_string(report.verdict)));
  for (const std::string& reason : report.reasons) text += "  - " + reason + "\n";

  text += "\nMOVE THE COUCH BY   (translate, then rotate about the isocenter)\n";
  if (shown.withheld)
    text += "  withheld: the result was rejected\n";
  else
    text += couch_rows(shown) + fmt::format("  IEC table angles after the move: yaw {}, pitch {}, roll {} deg\n",
                                            rounded(shown.couch_target_deg[0]), rounded(shown.couch_target_deg[1]),
                                            rounded(shown.couch_target_deg[2]));

  text += "\nSETUP ERROR         (where the patient lies, against the plan; +/-: two sigma)\n";
  if (shown.withheld)
    text += "  withheld: the result was rejected\n";
  else
    text += row("x", shown.setup_error_mm[0], "mm", kLateral, shown.sigma_mm[0]) +
            row("y", shown.setup_error_mm[1], "mm", kLongitudinal, shown.sigma_mm[1]) +
            row("z", shown.setup_error_mm[2], "mm", kVertical, shown.sigma_mm[2]) +
            row("about x", shown.setup_error_deg[0], "deg", kPitch, shown.sigma_deg[0]) +
            row("about y", shown.setup_error_deg[1], "deg", kRoll, shown.sigma_deg[1]) +
            row("about z", shown.setup_error_deg[2], "deg", kYaw, shown.sigma_deg[2]);
  if (report.translation_only) text += "  Only translations were searched; rotations were taken as 0.\n";

  text += "\nVIEWS               similarity at the planned pose -> at the pose found\n";
  for (const SetupReport::View& view : report.views)
    text += fmt::format("  {:<14} {:.4f} -> {:.4f}; {} of {} parts with signal match elsewhere\n", plain(view.label),
                        view.similarity_start, view.similarity_final,
                        std::ranges::count_if(view.parts, &SetupReport::Part::disagrees),
                        std::ranges::count_if(view.parts, &SetupReport::Part::has_signal));

  text += list("WARNINGS", report.warnings) + list("OVERRIDES", report.overrides);
  std::string settings;
  for (const auto& [name, value] : report.renderer_settings) settings += fmt::format(", {} {}", name, value);
  text += fmt::format(
      "\nCONVENTIONS\n"
      "  IEC 61217, mm and degrees. Facing the gantry: x to the right, y toward the gantry, z up; the origin is the\n"
      "  isocenter. Setup error: anatomy planned at p is found at R p + t, R = Rz Rx Ry. Couch: the table top's axes "
      "at\n"
      "  imaging; angles are changes of the table's read-outs. Shown to 0.1; result.json has full precision.\n\n"
      "Renderer     {} on {}{}; attenuation {}, threshold {:.0f} HU; seed {}\n"
      "Search       preset {}\n"
      "Region       {}\n"
      "Time         {:.1f} s, of which registration {:.1f} s\n",
      report.renderer, report.device, settings, report.attenuation, report.threshold_hu, report.seed, report.preset,
      report.region.empty() ? "everything" : plain(fmt::format("{}", fmt::join(report.region, "; "))),
      report.seconds_total, report.seconds_register);
  return text;
}

}  // namespace isoshift
