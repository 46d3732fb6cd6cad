// isoshift scout: a CT against its own scout.

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "cli/switches/rendering_switches.h"
#include "cli/switches/study_switches.h"
#include "geometry/rotation.h"
#include "workflow/scout/register_scout.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kAxisNames = {"left", "posterior", "superior", "about_left", "about_posterior", "about_superior"};
constexpr std::array kAxisWords = {"to the left",    "posterior",           "superior",
                                   "about the left", "about the posterior", "about the superior"};
constexpr bool is_rotation(std::size_t axis) { return axis >= 3; }

// mm, or degrees of radians.
double shown(std::size_t axis, double value) { return is_rotation(axis) ? deg_from_rad(value) : value; }

std::string text_of(const ScoutRegistration& found, const ScoutRequest& request) {
  std::string text = fmt::format(
      "SCOUT AGAINST ITS CT\nNot for clinical use unless validated by the site.\n\n"
      "CT           {}\nScout        {}, SHA-256 {}\n"
      "Tube         on the patient's {} side{}; gradient correlation {:.3f}, {:.3f} from the other side\n"
      "Rendered by  {} on {}\n\nVERDICT      {}\n",
      found.ct_series_instance_uid, request.scout.string(), found.scout_sha256, to_string(found.tube),
      request.tube ? " (--tube)" : ", where the scout matches better", found.match, found.match_from_other_side,
      found.renderer, found.device, to_string(found.verdict));
  for (const std::string& reason : found.reasons) text += fmt::format("  - {}\n", reason);
  if (found.verdict == Verdict::kRejected) return text + "\nOFFSET       withheld: the result was rejected\n";
  text += fmt::format(
      "\nOFFSET       (where the anatomy of the CT lies in the scout, against where the CT says; axes of the "
      "patient,\n              at ({:.1f}, {:.1f}, {:.1f}) mm, the center of the CT; +/- is two sigma)\n",
      found.center_patient_mm.x(), found.center_patient_mm.y(), found.center_patient_mm.z());
  for (std::size_t n = 0; n < found.axes.size(); ++n) {
    const ScoutAxis& axis = found.axes[n];
    text += axis.is_seen ? fmt::format("  {:<19} {:+6.2f} +/- {:.2f} {}\n", kAxisWords[n], shown(n, axis.offset),
                                       2.0 * shown(n, axis.sigma), is_rotation(n) ? "deg" : "mm")
                         : fmt::format("  {:<19} not seen by this scout\n", kAxisWords[n]);
  }
  text +=
      fmt::format("\nREPEATED     (from {} starts up to {:.0f} mm away: the largest distance from the offset above)\n",
                  found.starts, ScoutRegistration::kStartMm);
  for (std::size_t n = 0; n < found.axes.size(); ++n)
    if (found.axes[n].is_seen)
      text += fmt::format("  {:<19} {:6.3f} {}\n", kAxisWords[n], shown(n, found.axes[n].repeatability),
                          is_rotation(n) ? "deg" : "mm");
  return text;
}

std::string json_of(const ScoutRegistration& found, const ScoutRequest& request) {
  Json axes;
  for (std::size_t n = 0; n < found.axes.size(); ++n) {
    const ScoutAxis& axis = found.axes[n];
    const std::string unit = is_rotation(n) ? "deg" : "mm";
    axes[kAxisNames[n]] = {{"is_seen", axis.is_seen},
                           {"offset_" + unit, shown(n, axis.offset)},
                           {"sigma_" + unit, std::isfinite(axis.sigma) ? Json(shown(n, axis.sigma)) : Json(nullptr)},
                           {"repeatability_" + unit, shown(n, axis.repeatability)}};
  }
  const Json json = {
      {"verdict", to_string(found.verdict)},
      {"reasons", found.reasons},
      {"tube", to_string(found.tube)},
      {"tube_is_measured", !request.tube.has_value()},
      {"gradient_correlation", found.match},
      {"gradient_correlation_from_other_side", found.match_from_other_side},
      {"center_patient_mm", {found.center_patient_mm.x(), found.center_patient_mm.y(), found.center_patient_mm.z()}},
      {"axes", found.verdict == Verdict::kRejected ? Json(nullptr) : axes},
      {"starts", found.starts},
      {"starts_up_to_mm", ScoutRegistration::kStartMm},
      {"renderer", found.renderer},
      {"device", found.device},
      {"scout", {{"file", request.scout.string()}, {"sha256", found.scout_sha256}}},
      {"ct_series_instance_uid", found.ct_series_instance_uid},
      {"warnings", found.notes.warnings},
      {"overrides", found.notes.overrides}};
  return json.dump(2) + "\n";
}

}  // namespace

void add_scout_command(CLI::App& app, Console& console, int& exit_status) {
  auto request = std::make_shared<ScoutRequest>();
  auto allow = std::make_shared<std::vector<std::string>>();
  auto as_json = std::make_shared<bool>(false);
  std::vector<std::string> sides;
  sides.reserve(kTubeSides.size());
  for (const TubeSide side : kTubeSides) sides.emplace_back(to_string(side));
  CLI::App* command = app.add_subcommand(
      "scout", "Register a CT to its own scout, an X-ray at a known pose: the answer should be nothing");
  command->footer(
      "\nExample:\n  isoshift scout planning_ct/ scout.dcm\n\n"
      "A scout (topogram, surview) sees two axes of translation and the rotation about its rays.\n"
      "Exit status: 0 accepted, 1 failed, 2 usage, 3 review, 4 rejected.");
  command->add_option("ct", request->ct, "Folder or file of the CT")->required()->type_name("PATH");
  command->add_option("scout", request->scout, "The scout: a CT Image with the image type LOCALIZER")
      ->required()
      ->type_name("FILE");
  command
      ->add_option_function<std::string>(
          "--tube", [request](const std::string& side) { request->tube = tube_side_from(side); },
          "On which side of the patient the tube stood [the side from which the scout matches better]")
      ->check(CLI::IsMember(sides));
  command->add_option("--sad", request->distances.sad_mm, "Distance Source to Patient, where the file lacks it")
      ->type_name("MM");
  command->add_option("--sid", request->distances.sid_mm, "Distance Source to Detector, where the file lacks it")
      ->type_name("MM");
  add_allow_option(*command, *allow);
  command->add_option("--seed", request->seed, "Seed of the search and of the displaced starts")->capture_default_str();
  command->add_flag("--json", *as_json, "Print JSON instead of text");
  add_rendering_options(*command, request->rendering);
  command->callback([request, allow, as_json, &console, &exit_status] {
    request->allowed = allowances_from(*allow);
    ConsoleObserver observer(console);
    const ScoutRegistration found = register_scout(*request, observer);
    print_warnings(found.notes.warnings, console);
    console.out << (*as_json ? json_of(found, *request) : text_of(found, *request));
    exit_status = exit_status_of(found.verdict);
  });
}

}  // namespace isoshift
