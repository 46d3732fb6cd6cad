#include "workflow/register/study_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <ranges>

#include "base/error.h"
#include "base/option_name.h"
#include "geometry/rotation.h"

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
    throw UsageError(fmt::format("{}: \"{}\" is not a finite number", flag, text));
  return value;
}

}  // namespace

void check_finite(const std::string& flag, std::span<const double> values) {
  for (const double value : values)
    if (!std::isfinite(value)) throw UsageError(fmt::format("{}: {} is not a finite number", flag, value));
}

void check_couch_angles(const std::optional<double>& couch_angle_deg, const std::optional<double>& couch_pitch_deg,
                        const std::optional<double>& couch_roll_deg) {
  constexpr double kTurnDeg = 360.0;
  if (const double angle_deg = couch_angle_deg.value_or(0.0); !(std::abs(angle_deg) <= kTurnDeg))
    throw UsageError(fmt::format("{}: {}, expected degrees from -360 to 360", option("couch-angle"), angle_deg));
  for (const auto& [flag, angle_deg] : {std::pair(option("couch-pitch"), couch_pitch_deg.value_or(0.0)),
                                        std::pair(option("couch-roll"), couch_roll_deg.value_or(0.0))})
    if (!(std::abs(angle_deg) <= kTurnDeg) ||
        std::abs(wrapped_rad(rad_from_deg(angle_deg))) > rad_from_deg(kMaxTableTiltDeg))
      throw UsageError(
          fmt::format("{}: {}, expected degrees from -45 to 45: no table top tilts farther", flag, angle_deg));
}

namespace {

void check_count(std::string_view name, std::span<const double> values, std::size_t count) {
  if (!values.empty() && values.size() != count)
    throw UsageError(fmt::format("{}: {} numbers, expected {}", option(name), values.size(), count));
}

// What `from` makes of a word; nothing where there is none.
template <class From>
auto known(std::string_view name, const std::string& word, From from) -> decltype(from(word)) {
  if (word.empty()) return std::nullopt;
  const auto value = from(word);
  if (!value) throw UsageError(fmt::format("{}: there is no such value", option(name, word)));
  return value;
}

}  // namespace

void StudyOptions::check_numbers() const {
  check_count("isocenter", isocenter, 3);
  check_count("rt-image-position", rt_image_position, 2);
  check_finite(option("isocenter"), isocenter);
  check_finite(option("rt-image-position"), rt_image_position);
  check_couch_angles(couch_angle_deg, couch_pitch_deg, couch_roll_deg);
  check_finite(option("sad", "MM"), std::array{sad_mm.value_or(0.0)});
  check_finite(option("sid", "MM"), std::array{sid_mm.value_or(0.0)});
}

std::optional<MachineProfile> named_machine(const std::filesystem::path& profile, const std::filesystem::path& key) {
  if (profile.empty() && !key.empty())
    throw UsageError(
        fmt::format("{} says who signed the profile: name that with {}", option("machine-key"), option("machine")));
  if (profile.empty()) return std::nullopt;
  return read_machine_profile(profile, key.empty() ? std::nullopt : std::optional(VerifyingKey(key)));
}

Allowances allowances_from(std::span<const std::string> allow) {
  Allowances allowed;
  for (const std::string& text : allow) {
    const auto [key, reason] = key_and_value(text, option("allow"));
    if (std::ranges::find(kAllowKeys, key, &AllowKey::key) == std::end(kAllowKeys))
      throw UsageError(fmt::format("{}: no check has this key; the keys are {}", option("allow", key),
                                   fmt::join(kAllowKeys | std::views::transform(&AllowKey::key), ", ")));
    if (reason.find_first_not_of(" \t") == std::string::npos)
      throw UsageError(fmt::format("{}: the reason is empty", option("allow", fmt::format("{}={}", key, reason))));
    if (!allowed.emplace(key, reason).second) throw UsageError(fmt::format("{}: is there twice", option("allow", key)));
  }
  return allowed;
}

StudyRequest StudyOptions::request() const {
  check_numbers();
  StudyRequest request;
  if (parts.study.empty() && (parts.ct.empty() || parts.images.empty()))
    throw UsageError(
        fmt::format("which study? Name its folder, or its parts with {} and {}", option("ct"), option("image")));
  request.parts = parts;
  if (!isocenter.empty()) request.isocenter_patient_mm = Eigen::Vector3d(isocenter.data());
  for (const std::string& text : gantry_angles) {
    const auto [label, angle] = key_and_value(text, option("gantry-angle"));
    const double angle_deg = number_from(angle, option("gantry-angle"));
    if (!request.switches.gantry_angle_deg.emplace(label, angle_deg).second)
      throw UsageError(fmt::format("{}: {} is there twice", option("gantry-angle"), label));
  }
  request.max_span_s = max_span_s;
  request.switches.couch_angle_deg = couch_angle_deg;
  request.switches.couch_pitch_deg = couch_pitch_deg;
  request.switches.couch_roll_deg = couch_roll_deg;
  request.switches.sad_mm = sad_mm;
  request.switches.sid_mm = sid_mm;
  if (!rt_image_position.empty()) request.switches.position_mm = Eigen::Vector2d(rt_image_position.data());
  request.switches.assume_centered = assume_centered;
  request.switches.intensity = known("intensity", intensity, &pixel_intensity_from);
  if (!beam.empty()) request.switches.beam = beam == "kv" ? Beam::kKilovoltage : Beam::kMegavoltage;
  request.switches.patient_position = known("patient-position", patient_position, &patient_position_from);
  request.machine = named_machine(machine, machine_key);
  request.allowed = allowances_from(allow);
  return request;
}

Study load(const StudyOptions& options, Notes& notes, Observer& observer, CtStore& cts) {
  const auto progress = [&](std::size_t done, std::size_t total) { observer.progress("Reading CT", done, total); };
  Study study = load_study(options.request(), notes, progress, cts);
  for (const std::string& file : notes.left_aside) observer.say("left aside: " + file);
  return study;
}

std::vector<Beam> beams_of(const Study& study) {
  std::vector<Beam> beams;
  for (const XrayImage& xray : study.xrays)
    if (std::ranges::find(beams, xray.view.beam) == beams.end()) beams.push_back(xray.view.beam);
  return beams;
}

}  // namespace isoshift
