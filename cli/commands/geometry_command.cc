// isoshift qa geometry: what X-rays of a phantom with balls, or registrations of patients, tell about their imagers,
// and what they do not.

#include <fmt/format.h>

#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/json_file.h"
#include "cli/commands/commands.h"
#include "cli/switches/study_switches.h"
#include "geometry/motion_axes.h"
#include "geometry/rotation.h"
#include "io/report/report_page.h"
#include "setup/setup_errors.h"
#include "workflow/imager/ball_geometry.h"
#include "workflow/imager/patient_geometry.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct GeometryFlags {
  BallGeometryRequest request;
  std::filesystem::path moves, positions, patients;
  bool as_json = false;
};

double shown(const ImagerParameterInfo& info, double value) { return info.is_angle ? deg_from_rad(value) : value; }

std::string words_of(BallPoses poses) {
  switch (poses) {
    case BallPoses::kFree: return "nothing: every session's pose is estimated, too";
    case BallPoses::kMoves: return "how it moved between the sessions";
    case BallPoses::kPositions: return "where it lay";
  }
  return "";
}

// Of a motion, mm and degrees (kErrorComponents); nothing for what is not determined.
using Components = std::array<std::optional<double>, 6>;

Components determined(const Eigen::Isometry3d& motion, const std::array<double, 6>& sigmas) {
  // What is enough for a shift and for a roll of an imager is enough for a pose.
  const auto largest_sigma = [](ImagerParameter of) {
    return imager_parameters()[static_cast<std::size_t>(of)].largest_sigma;
  };
  const double of_shift = largest_sigma(ImagerParameter::kShiftX), of_turn = largest_sigma(ImagerParameter::kRoll);
  const auto values = components_of(motion);
  Components components;
  for (std::size_t n = 0; n < components.size(); ++n)
    if (sigmas[n] <= (is_rotation(n) ? of_turn : of_shift)) components[n] = values[n];
  return components;
}

Components pose_of(const BundleAdjustment& adjustment, std::size_t session) {
  return determined(adjustment.setup_errors[session], adjustment.pose_sigmas[session]);
}

// Against the first session.
Components move_of(const BundleAdjustment& adjustment, std::size_t session) {
  return determined(adjustment.setup_errors[session] * adjustment.setup_errors.front().inverse(),
                    adjustment.move_sigmas[session]);
}

std::string row_of(const std::string& session, const Components& components) {
  std::string row = fmt::format("  {:<20}", session);
  for (const auto& component : components)
    row += component ? fmt::format(" {:+8.3f}", *component) : fmt::format(" {:>8}", "-");
  return row + "\n";
}

Json json_of(const Components& components) {
  Json json;
  for (std::size_t axis = 0; axis < components.size(); ++axis)
    json[kErrorComponents[axis]] = components[axis] ? Json(*components[axis]) : Json(nullptr);
  return json;
}

std::string text_of(const std::vector<std::string>& imagers, const std::vector<ImagerEstimate>& estimates) {
  std::string text;
  for (std::size_t imager = 0; imager < imagers.size(); ++imager) {
    text +=
        fmt::format("\nIMAGER {:<6} (the receptor against what the files say, axes of the gantry; +/- is two sigma)\n",
                    imagers[imager]);
    std::string unknown;
    for (std::size_t n = 0; n < kImagerParameters; ++n) {
      const ImagerParameterInfo& info = imager_parameters()[n];
      const ImagerEstimate::Parameter& found = estimates[imager].parameters[n];
      if (found.is_determined)
        text += fmt::format("  {:<38} {:+7.3f} +/- {:.3f} {}\n", info.name, shown(info, found.value),
                            2.0 * shown(info, found.sigma), info.is_angle ? "deg" : "mm");
      else
        unknown += fmt::format("  {:<38} +/- {:.1f} {}: it {}\n", info.name, 2.0 * shown(info, found.sigma),
                               info.is_angle ? "deg" : "mm", info.why_undetermined);
    }
    if (!unknown.empty()) text += "  not determined:\n" + unknown;
  }
  return text;
}

std::string text_of(const PatientGeometry& geometry) {
  std::string text = fmt::format(
      "GEOMETRY OF IMAGERS\n{}\n\nPatients     CTs {}, sessions {}, X-rays {}\n"
      "Misfit       {:.2f} (what single views want, in their own sigmas)\n",
      kDisclaimer, geometry.cts, geometry.sessions, geometry.views, geometry.found.misfit);
  std::vector<std::string> names;  // of those that saw enough CTs
  std::vector<ImagerEstimate> estimates;
  for (std::size_t imager = 0; imager < geometry.imagers.size(); ++imager) {
    if (const std::size_t cts = geometry.found.cts[imager]; cts < kLeastCts) {
      text += fmt::format("             {} saw {} {}: nothing is determined by fewer than {}\n",
                          geometry.imagers[imager], cts, cts == 1 ? "CT" : "CTs", kLeastCts);
    } else {
      names.push_back(geometry.imagers[imager]);
      estimates.push_back(geometry.found.imagers[imager]);
    }
  }
  for (const auto& [why, count] : geometry.left_out) text += fmt::format("Left out     {} {}\n", count, why);
  return text + text_of(names, estimates);
}

std::string text_of(const BallGeometry& geometry, BallPoses poses) {
  const BundleAdjustment& adjustment = geometry.adjustment;
  std::string text = fmt::format(
      "GEOMETRY OF IMAGERS\n{}\n\nPhantom      balls {}, sessions {}, X-rays {}; {} of {} places of balls used\n"
      "Known of it  {}\nWhat remains {:.3f} mm on the receptor (root mean square per axis)\n",
      kDisclaimer, geometry.balls, geometry.sessions.size(), geometry.views, adjustment.seen, adjustment.expected,
      words_of(poses), adjustment.rms_mm);
  text += text_of(geometry.imagers, adjustment.imagers);
  text +=
      "\nPOSES        (setup errors, IEC 61217 fixed: x, y, z in mm; about x, y, z in degrees; -: not determined)\n";
  for (std::size_t n = 0; n < geometry.sessions.size(); ++n)
    text += row_of(geometry.sessions[n], pose_of(adjustment, n));
  if (geometry.sessions.size() < 2) return text;
  text += fmt::format("\nMOVES        (against session {}, likewise)\n", geometry.sessions.front());
  for (std::size_t n = 1; n < geometry.sessions.size(); ++n)
    text += row_of(geometry.sessions[n], move_of(adjustment, n));
  return text;
}

Json json_of(const std::vector<std::string>& imagers, const std::vector<ImagerEstimate>& estimates) {
  Json json = Json::object();
  for (std::size_t imager = 0; imager < imagers.size(); ++imager)
    for (std::size_t n = 0; n < kImagerParameters; ++n) {
      const ImagerParameterInfo& info = imager_parameters()[n];
      const ImagerEstimate::Parameter& found = estimates[imager].parameters[n];
      json[imagers[imager]][std::string(info.key)] = {
          {"value", found.is_determined ? Json(shown(info, found.value)) : Json(nullptr)},
          {"sigma", shown(info, found.sigma)},
          {"is_determined", found.is_determined}};
    }
  return json;
}

std::string json_of(const PatientGeometry& geometry) {
  Json json = {{"schema", 1},
               {"cts", geometry.cts},
               {"sessions", geometry.sessions},
               {"xrays", geometry.views},
               {"left_out", geometry.left_out},
               {"misfit", geometry.found.misfit},
               {"imagers", json_of(geometry.imagers, geometry.found.imagers)}};
  for (std::size_t imager = 0; imager < geometry.imagers.size(); ++imager)
    json["cts_by_imager"][geometry.imagers[imager]] = geometry.found.cts[imager];
  return json_text(json);
}

std::string json_of(const BallGeometry& geometry) {
  const BundleAdjustment& adjustment = geometry.adjustment;
  Json json = {{"schema", 1},
               {"balls", geometry.balls},
               {"places_used", adjustment.seen},
               {"places_expected", adjustment.expected},
               {"rms_mm", adjustment.rms_mm},
               {"imagers", json_of(geometry.imagers, adjustment.imagers)},
               {"sessions", Json::object()},
               {"warnings", geometry.notes.warnings},
               {"overrides", geometry.notes.overrides}};
  for (std::size_t n = 0; n < geometry.sessions.size(); ++n)
    json["sessions"][geometry.sessions[n]] = {{"setup_error", json_of(pose_of(adjustment, n))},
                                              {"moved", json_of(move_of(adjustment, n))}};
  return json_text(json);
}

void run_geometry(GeometryFlags& flags, Console& console) {
  BallGeometryRequest& request = flags.request;
  if (flags.patients.empty() == request.sessions.empty())
    throw UsageError("name the sessions of a phantom with balls, or with --patients the results of patients");
  if (!flags.patients.empty()) {
    const PatientGeometry geometry = patient_geometry(flags.patients);
    console.out << (flags.as_json ? json_of(geometry) : text_of(geometry));
    return;
  }
  if (!flags.moves.empty() && !flags.positions.empty())
    throw UsageError("--moves and --positions: give one of them; positions hold the moves between them");
  request.poses = !flags.moves.empty()       ? BallPoses::kMoves
                  : !flags.positions.empty() ? BallPoses::kPositions
                                             : BallPoses::kFree;
  request.known_poses = !flags.moves.empty() ? flags.moves : flags.positions;
  ConsoleObserver observer(console);
  const BallGeometry geometry = ball_geometry(request, observer);
  print_warnings(geometry.notes.warnings, console);
  console.out << (flags.as_json ? json_of(geometry) : text_of(geometry, request.poses));
}

}  // namespace

void add_geometry_command(CLI::App& app, Console& console, int&) {
  auto flags = std::make_shared<GeometryFlags>();
  BallGeometryRequest& request = flags->request;
  CLI::App* command = app.add_subcommand(
      "geometry", "Find how imagers differ from what their files say, by X-rays of metal balls or results of patients");
  command->footer(
      "\nExample:\n  isoshift qa geometry monday/ tuesday/ --ct ball-phantom/ --positions where-it-lay.csv\n"
      "  isoshift qa geometry --patients results/\n\n"
      "Every folder is a session: X-rays at several gantry angles. What X-rays cannot tell is named as not "
      "determined.");
  command->add_option("sessions", request.sessions, "A folder of X-rays of the phantom per session")
      ->type_name("FOLDER...");
  command->add_option("--ct", request.study.parts.ct, "CT of the phantom [in the sessions' folders]")
      ->type_name("PATH");
  command->add_option("--plan", request.study.parts.plan, "RT Plan [in the sessions' folders]")->type_name("FILE");
  command
      ->add_option("--moves", flags->moves,
                   "CSV of how the phantom lay in every session, up to one motion that all share: session, x_mm, y_mm, "
                   "z_mm, rx_deg, ry_deg, rz_deg")
      ->type_name("FILE");
  command->add_option("--positions", flags->positions, "The same of where the phantom lay against its plan")
      ->type_name("FILE");
  command->add_flag("--json", flags->as_json, "Print JSON instead of text");
  add_study_switches(*command, request.study);
  // Results say themselves what was registered, and nobody knows how patients lay.
  const std::vector<CLI::Option*> of_phantoms = command->get_options([](const CLI::Option* option) {
    return !option->get_positional() && !option->check_name("--help") && !option->check_name("--json");
  });
  CLI::Option* patients =
      command
          ->add_option("--patients", flags->patients,
                       "Results of patients' sessions (register, batch, watch), instead of X-rays of a phantom")
          ->type_name("RESULTS");
  for (CLI::Option* option : of_phantoms) patients->excludes(option);
  command->callback([flags, &console] { run_geometry(*flags, console); });
}

}  // namespace isoshift
