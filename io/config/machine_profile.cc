#include "io/config/machine_profile.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>

#include "base/error.h"
#include "base/json_file.h"
#include "base/option_name.h"
#include "base/text_file.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

Eigen::Matrix<double, 3, 4> matrix_from(const std::vector<std::vector<double>>& rows, const JsonSection& section) {
  constexpr const char* kExpected = "three rows of four finite numbers";
  Eigen::Matrix<double, 3, 4> matrix;
  if (rows.size() != 3) section.refuse("pixel_from_room", kExpected);
  for (std::size_t row = 0; row < 3; ++row) {
    if (rows[row].size() != 4) section.refuse("pixel_from_room", kExpected);
    matrix.row(static_cast<Eigen::Index>(row)) = Eigen::RowVector4d(rows[row].data());
  }
  return matrix;
}

// What isoshift qa geometry --json says of an imager; every error, so that none counts as known by being left out.
std::optional<KnownImager> known_imager_from(JsonSection& section) {
  std::optional<JsonSection> errors = section.section("imager_errors");
  const bool is_corrected = section.find<bool>("correct_imager", "true or false").value_or(false);
  if (!errors) {
    if (is_corrected) section.refuse_missing("imager_errors", "what correct_imager corrects");
    return std::nullopt;
  }
  KnownImager imager{.is_corrected = is_corrected};
  for (std::size_t n = 0; n < kImagerParameters; ++n) {
    const ImagerParameterInfo& info = imager_parameters()[n];
    const std::string key(info.key);
    std::optional<JsonSection> error = errors->section(key.c_str());
    if (!error) errors->refuse_missing(key.c_str(), R"({"value": ..., "sigma": ...})");
    const double most = info.is_angle ? 10.0 : 200.0, unit = info.is_angle ? rad_from_deg(1.0) : 1.0;
    const std::optional<double> sigma = error->number("sigma", 0.0, most);
    if (!sigma) error->refuse_missing("sigma", "one standard deviation");
    imager.sigmas[n] = unit * *sigma;
    if (const auto value = error->find<nlohmann::json>("value", "a number or null"); value && !value->is_null())
      imager.values[n] = unit * error->number("value", -most, most).value();
    error->find<bool>("is_determined", "true or false");
    error->end();
  }
  errors->end();
  return imager;
}

// Those that are not 0.
std::string words_of(const ImagerErrors& values) {
  std::vector<std::string> words;
  for (std::size_t n = 0; n < values.size(); ++n) {
    const ImagerParameterInfo& info = imager_parameters()[n];
    if (values[n] == 0.0) continue;
    words.push_back(info.is_angle ? fmt::format("{} {:+.3f} deg", info.name, deg_from_rad(values[n]))
                                  : fmt::format("{} {:+.2f} mm", info.name, values[n]));
  }
  return fmt::format("{}", fmt::join(words, ", "));
}

MachineProfile::Rule rule_from(JsonSection section) {
  MachineProfile::Rule rule;
  using Words = std::map<std::string, std::string, std::less<>>;
  rule.where = section.find<Words>("where", "an object of keywords and texts").value_or(Words());
  for (const auto& [keyword, value] : rule.where)
    if (!kEquipmentAttributes.contains(keyword)) {
      std::string known;
      for (const auto& [name, tag] : kEquipmentAttributes) known += (known.empty() ? "" : ", ") + name;
      throw Error(
          fmt::format("{}: where: images are not told apart by {}, but by {}", section.where(), keyword, known));
    }
  rule.gantry_angle_offset_deg = section.number("gantry_angle_offset_deg", -360, 360);
  if (const auto plane = section.find<std::string>("spacing_plane", "SID or SAD")) {
    if (plane != "SID" && plane != "SAD") section.refuse("spacing_plane", "SID or SAD");
    rule.spacing_at_axis = plane == "SAD";
  }
  rule.imager = known_imager_from(section);
  rule.switches.assume_centered = section.find<bool>("assume_centered", "true or false").value_or(false);
  rule.switches.sad_mm = section.number("sad_mm", 1, 5000);
  rule.switches.sid_mm = section.number("sid_mm", 1, 5000);
  rule.switches.couch_angle_deg = section.number("couch_angle_deg", -360, 360);
  rule.switches.couch_pitch_deg = section.number("couch_pitch_deg", -kMaxTableTiltDeg, kMaxTableTiltDeg);
  rule.switches.couch_roll_deg = section.number("couch_roll_deg", -kMaxTableTiltDeg, kMaxTableTiltDeg);
  if (const auto word = section.find<std::string>("intensity", "LIN+, LIN-, LOG+ or LOG-")) {
    rule.switches.intensity = pixel_intensity_from(*word);
    if (!rule.switches.intensity) section.refuse("intensity", "LIN+, LIN-, LOG+ or LOG-");
  }
  if (const auto beam = section.find<std::string>("beam", "kv or mv")) {
    if (beam != "kv" && beam != "mv") section.refuse("beam", "kv or mv");
    rule.switches.beam = beam == "kv" ? Beam::kKilovoltage : Beam::kMegavoltage;
  }
  if (const auto rows =
          section.find<std::vector<std::vector<double>>>("pixel_from_room", "three rows of four numbers")) {
    rule.pixel_from_room = matrix_from(*rows, section);
    rule.columns = section.required<int>("columns", "the width of the images, in pixels");
    rule.rows = section.required<int>("rows", "the height of the images, in pixels");
    if (!rule.switches.sid_mm)
      throw Error(fmt::format("{}: sid_mm is missing, which pixel_from_room needs", section.where()));
    if (rule.gantry_angle_offset_deg.value_or(0.0) != 0.0 || rule.spacing_at_axis || rule.imager ||
        rule.switches.assume_centered || rule.switches.sad_mm || rule.switches.position_mm)
      throw Error(fmt::format("{}: pixel_from_room says where all pixels are; it goes with no other geometry",
                              section.where()));
  }
  section.end();
  return rule;
}

// FILE.sig beside FILE, as openssl pkeyutl writes it.
void require_signature(const std::filesystem::path& path, const std::string& text, const VerifyingKey& key) {
  const std::string name = path.string() + ".sig";
  expect_no_pipe(name);
  std::ifstream file(name, std::ios::binary);
  if (!file)
    throw Error(fmt::format("{}: cannot be read; {} needs the signature of the profile", name, option("machine-key")));
  const std::string signature{std::istreambuf_iterator<char>(file), {}};
  if (!key.accepts(text, signature))
    throw Error(
        fmt::format("{}: is not the signature of {} by the key of {}: the profile was changed after it was signed, or "
                    "somebody else signed it",
                    name, path.string(), option("machine-key")));
}

bool fits(const MachineProfile::Rule& rule, const RtImage& image) {
  return std::ranges::all_of(rule.where, [&](const auto& wanted) {
    const auto found = image.equipment.find(wanted.first);
    return found != image.equipment.end() && found->second == wanted.second;
  });
}

}  // namespace

MachineProfile read_machine_profile(const std::filesystem::path& path, const std::optional<VerifyingKey>& key) {
  const JsonFile file = read_json_file(path);
  if (key) require_signature(path, file.text, *key);
  JsonSection section(file.json, path.string());
  if (const int version = section.required<int>("machine_profile", "1, the version of its format"); version != 1)
    section.refuse("machine_profile", "1, the version of its format");
  MachineProfile profile{.path = path, .name = section.required<std::string>("name", "a text"), .sha256 = file.sha256};
  const auto images = section.required<std::vector<nlohmann::json>>("images", "a list of rules");
  for (std::size_t n = 0; n < images.size(); ++n)
    profile.rules.push_back(rule_from(JsonSection(images[n], fmt::format("{}: images[{}]", path.string(), n))));
  section.end();
  const auto corrects = [](const MachineProfile::Rule& rule) { return rule.imager && rule.imager->is_corrected; };
  if (!key && std::ranges::any_of(profile.rules, corrects))
    throw Error(
        fmt::format("{0}: correct_imager changes where X-rays are taken to lie: such a profile must be "
                    "signed.\n       Sign it: openssl pkeyutl -sign -rawin -inkey PRIVATE -in {0} -out {0}.sig\n"
                    "       and name the public key: {1}",
                    path.string(), option("machine-key", "FILE")));
  if (profile.rules.empty()) throw Error(fmt::format("{}: images is empty, expected a list of rules", path.string()));
  return profile;
}

RtImage with_machine(RtImage image, const MachineProfile& profile, const RtImageSwitches& command_line, Notes& notes) {
  const auto rule = std::ranges::find_if(profile.rules, [&](const auto& candidate) { return fits(candidate, image); });
  if (rule == profile.rules.end()) {
    std::string attributes;
    for (const auto& [keyword, value] : image.equipment) attributes += fmt::format(" {}=\"{}\"", keyword, value);
    throw Error(fmt::format("{}: no rule of machine profile \"{}\" fits this image:{}", image.path.string(),
                            profile.name, attributes));
  }
  const std::string origin = fmt::format("machine profile \"{}\"", profile.name);
  const auto note = [&](const std::string& what) {
    notes.overrides.push_back(fmt::format("{}: {} by {}", image.label, what, origin));
  };
  image = with_switches(image, rule->switches, notes, origin);
  // What the command line will replace decides what the other rules make of the file's values.
  const std::optional<double> sad_mm = command_line.sad_mm ? command_line.sad_mm : image.sad_mm;
  const std::optional<double> sid_mm = command_line.sid_mm ? command_line.sid_mm : image.sid_mm;
  if (rule->pixel_from_room) {
    if (image.columns != rule->columns || image.rows != rule->rows)
      throw Error(fmt::format("{}: has {} x {} pixels; the projection matrix of {} is for {} x {}", image.path.string(),
                              image.columns, image.rows, origin, rule->columns, rule->rows));
    image.pixel_from_room = rule->pixel_from_room;
    note("projection matrix supplied");
  }
  image.gantry_offset_deg = rule->gantry_angle_offset_deg;
  if (const double offset_deg = rule->gantry_angle_offset_deg.value_or(0.0);
      offset_deg != 0.0 && image.gantry_angle_deg) {
    *image.gantry_angle_deg += offset_deg;
    note(fmt::format("{} {:+} degrees", described(DCM_GantryAngle), offset_deg));
  }
  if (rule->spacing_at_axis && sad_mm && sid_mm) {
    const double magnified = *sid_mm / *sad_mm;
    if (image.pixel_spacing_mm) *image.pixel_spacing_mm *= magnified;
    if (image.position_mm) *image.position_mm *= magnified;
    note(fmt::format("{} brought from the axis to the receptor", described(DCM_ImagePlanePixelSpacing)));
  }
  if (rule->imager) {
    image.imager = rule->imager;
    image.imager->number = static_cast<std::size_t>(rule - profile.rules.begin());
    if (rule->imager->is_corrected) note(fmt::format("receptor corrected ({})", words_of(rule->imager->values)));
  }
  return image;
}

}  // namespace isoshift
