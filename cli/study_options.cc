#include "cli/study_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "geometry/error.h"

namespace isoshift {
namespace {

// "KEY=VALUE" at its first "=".
std::pair<std::string, std::string> key_and_value(const std::string& text, std::string_view flag) {
  const auto equals = text.find('=');
  if (equals == std::string::npos || equals == 0 || equals + 1 == text.size())
    throw UsageError(fmt::format("{} {}: expected two parts joined by =", flag, text));
  return {text.substr(0, equals), text.substr(equals + 1)};
}

double number_from(const std::string& text, std::string_view flag) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    throw UsageError(fmt::format("{}: \"{}\" is no finite number", flag, text));
  return value;
}

std::string allow_keys_help() {
  std::string help = "Allow what a check forbids, with the reason. KEY is one of";
  for (const AllowKey& key : kAllowKeys) help += fmt::format("\n{}: {}", key.key, key.meaning);
  return help;
}

}  // namespace

void StudyOptions::check_finite() const {
  const auto check = [](const char* flag, const auto& values) {
    for (const double value : values)
      if (!std::isfinite(value)) throw UsageError(fmt::format("{}: {} is no finite number", flag, value));
  };
  check("--isocenter", isocenter);
  check("--rt-image-position", rt_image_position);
  check("--couch-angle", std::array{couch_angle_deg.value_or(0.0)});
  check("--couch-pitch", std::array{couch_pitch_deg.value_or(0.0)});
  check("--couch-roll", std::array{couch_roll_deg.value_or(0.0)});
  check("--sad", std::array{sad_mm.value_or(0.0)});
  check("--sid", std::array{sid_mm.value_or(0.0)});
}

StudyRequest StudyOptions::request() const {
  check_finite();
  StudyRequest request;
  if (study.empty() && (ct.empty() || images.empty()))
    throw UsageError("which study? Name its folder, or its parts with --ct and --image");
  request.parts = {.study = study, .ct = ct, .images = images, .plan = std::nullopt};
  if (!plan.empty()) request.parts.plan = plan;
  if (!structures.empty()) request.parts.structures = structures;
  if (!isocenter.empty()) request.isocenter_patient_mm = Eigen::Vector3d(isocenter.data());
  for (const std::string& text : gantry_angles) {
    const auto [label, angle] = key_and_value(text, "--gantry-angle");
    request.switches.gantry_angle_deg[label] = number_from(angle, "--gantry-angle");
  }
  request.switches.couch_angle_deg = couch_angle_deg;
  request.switches.couch_pitch_deg = couch_pitch_deg;
  request.switches.couch_roll_deg = couch_roll_deg;
  request.switches.sad_mm = sad_mm;
  request.switches.sid_mm = sid_mm;
  if (!rt_image_position.empty()) request.switches.position_mm = Eigen::Vector2d(rt_image_position.data());
  request.switches.assume_centered = assume_centered;
  if (!intensity.empty()) request.switches.intensity = pixel_intensity_from(intensity);
  if (!beam.empty()) request.switches.beam = beam == "kv" ? Beam::kKilovoltage : Beam::kMegavoltage;
  if (!patient_position.empty()) request.switches.patient_position = patient_position_from(patient_position);
  if (!machine.empty()) request.machine = read_machine_profile(machine);
  for (const std::string& text : allow) {
    const auto [key, reason] = key_and_value(text, "--allow");
    if (std::ranges::find(kAllowKeys, key, &AllowKey::key) == std::end(kAllowKeys))
      throw UsageError(fmt::format("--allow {}: no check has this key", key));
    request.allowed[key] = reason;
  }
  return request;
}

void add_study_options(CLI::App& command, StudyOptions& options) {
  command.add_option("study", options.study, "Folder of the exported study; its parts are found by what they are")
      ->type_name("FOLDER");
  const char* parts = "Parts of the study";
  command.add_option("--ct", options.ct, "Folder or files of the planning CT")->type_name("PATH")->group(parts);
  command
      .add_option("--image", options.images,
                  "RT Images (X-rays), files or folders; with --machine X-rays of other classes, too")
      ->type_name("PATH")
      ->group(parts);
  command.add_option("--plan", options.plan, "RT Plan")->type_name("FILE")->group(parts);
  command
      .add_option("--structures", options.structures,
                  "RT Structure Set; else the one that the plan refers to, else the only one drawn on the CT")
      ->type_name("FILE")
      ->group(parts);
  add_study_switches(command, options);
}

void add_study_switches(CLI::App& command, StudyOptions& options) {
  const char* lacking = "What the files lack (never guessed; each use is written into the result)";
  command.add_option("--isocenter", options.isocenter, "Planned isocenter in patient coordinates of the CT, mm")
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,Z")
      ->group(lacking);
  command.add_option("--patient-position", options.patient_position, "How the patient lies on the table")
      ->check(CLI::IsMember({"HFS", "HFP", "FFS", "FFP", "HFDR", "HFDL", "FFDR", "FFDL"}))
      ->group(lacking);
  command.add_option("--couch-angle", options.couch_angle_deg, "Patient support angle at imaging, IEC 61217")
      ->type_name("DEG")
      ->group(lacking);
  command
      .add_option("--couch-pitch", options.couch_pitch_deg,
                  "Table top pitch angle at imaging, IEC 61217: positive with the gantry end up")
      ->type_name("DEG")
      ->group(lacking);
  command
      .add_option(
          "--couch-roll", options.couch_roll_deg,
          "Table top roll angle at imaging, IEC 61217: positive with the right side down, seen facing the gantry")
      ->type_name("DEG")
      ->group(lacking);
  command.add_option("--gantry-angle", options.gantry_angles, "Gantry angle of the image with this label, IEC 61217")
      ->type_name("LABEL=DEG")
      ->group(lacking);
  command.add_option("--sad", options.sad_mm, "Source to axis distance")->type_name("MM")->group(lacking);
  command.add_option("--sid", options.sid_mm, "Source to image plane distance")->type_name("MM")->group(lacking);
  command.add_option("--rt-image-position", options.rt_image_position, "Center of the first pixel on the receptor, mm")
      ->delimiter(',')
      ->expected(2)
      ->type_name("X,Y")
      ->group(lacking);
  command.add_flag("--assume-centered", options.assume_centered, "Images without RT Image Position are centered")
      ->group(lacking);
  command
      .add_option("--intensity", options.intensity,
                  "Pixel intensity relationship, and its sign for stored values: + higher stored value, more X-ray")
      ->check(CLI::IsMember({"LIN+", "LIN-", "LOG+", "LOG-"}))
      ->group(lacking);
  command.add_option("--beam", options.beam, "Beam quality of all images")
      ->check(CLI::IsMember({"kv", "mv"}))
      ->group(lacking);
  command
      .add_option("--machine", options.machine,
                  "Machine profile: what a machine's files lack or say wrongly (docs/machine-profile.md)")
      ->type_name("FILE")
      ->group(lacking);
  command.add_option("--allow", options.allow, allow_keys_help())->type_name("KEY=REASON")->group(lacking);
}

Study load(const StudyOptions& options, Notes& notes, Console& console, CtStore& cts) {
  const StudyRequest request = options.request();
  ProgressBar bar(console, "Reading CT");
  Study study = load_study(
      request, notes, [&](std::size_t done, std::size_t total) { bar.update(done, total); }, cts);
  for (const std::string& file : notes.left_aside) console.err << "left aside: " << file << "\n";
  return study;
}

std::vector<Beam> beams_of(const Study& study) {
  std::vector<Beam> beams;
  for (const XrayImage& xray : study.xrays)
    if (std::ranges::find(beams, xray.view.beam) == beams.end()) beams.push_back(xray.view.beam);
  return beams;
}

}  // namespace isoshift
