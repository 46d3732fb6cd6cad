#include "io/machine_profile.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "geometry/error.h"

namespace isoshift {
namespace {

using Json = nlohmann::json;

std::string sha256_of(const std::string& content) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  if (EVP_Digest(content.data(), content.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1)
    throw Error("SHA-256 is not available");
  return fmt::format("{:02x}", fmt::join(digest.begin(), digest.begin() + size, ""));
}

// An object of the file, with its place in it for messages. Every key must be asked for: what is left is a mistake.
class Section {
 public:
  Section(const Json& json, std::string where) : json_(json), where_(std::move(where)) {
    if (!json_.is_object()) throw Error(fmt::format("{}: expected an object", where_));
  }

  template <class T>
  std::optional<T> find(const char* key, const char* expected) {
    known_.emplace_back(key);
    if (!json_.contains(key)) return std::nullopt;
    try {
      return json_.at(key).get<T>();
    } catch (const Json::exception&) {
      refuse(key, expected);
    }
  }
  template <class T>
  T required(const char* key, const char* expected) {
    if (auto value = find<T>(key, expected)) return *value;
    throw Error(fmt::format("{}: {} is missing, expected {}", where_, key, expected));
  }
  std::optional<double> number(const char* key, double low, double high) {
    const auto value = find<double>(key, "a number");
    if (value && !(*value >= low && *value <= high))
      throw Error(fmt::format("{}: {} is {}, expected {} to {}", where_, key, *value, low, high));
    return value;
  }
  [[noreturn]] void refuse(const char* key, const char* expected) const {
    throw Error(fmt::format("{}: {} is {}, expected {}", where_, key, json_.at(key).dump(), expected));
  }
  void end() const {
    for (const auto& [key, value] : json_.items())
      if (std::ranges::find(known_, key) == known_.end())
        throw Error(fmt::format("{}: there is no key {}; the keys are {}", where_, key, fmt::join(known_, ", ")));
  }

 private:
  const Json& json_;
  std::string where_;
  std::vector<std::string> known_;
};

Eigen::Matrix<double, 3, 4> matrix_from(const std::vector<std::vector<double>>& rows, const Section& section) {
  constexpr const char* kExpected = "three rows of four finite numbers";
  Eigen::Matrix<double, 3, 4> matrix;
  if (rows.size() != 3) section.refuse("pixel_from_room", kExpected);
  for (std::size_t row = 0; row < 3; ++row) {
    if (rows[row].size() != 4) section.refuse("pixel_from_room", kExpected);
    matrix.row(static_cast<Eigen::Index>(row)) = Eigen::RowVector4d(rows[row].data());
  }
  return matrix;
}

MachineProfile::Rule rule_from(Section section, const std::string& where) {
  MachineProfile::Rule rule;
  using Words = std::map<std::string, std::string, std::less<>>;
  rule.where = section.find<Words>("where", "an object of keywords and texts").value_or(Words());
  for (const auto& [keyword, value] : rule.where)
    if (!kEquipmentAttributes.contains(keyword)) {
      std::string known;
      for (const auto& [name, tag] : kEquipmentAttributes) known += (known.empty() ? "" : ", ") + name;
      throw Error(fmt::format("{}: where: images are not told apart by {}, but by {}", where, keyword, known));
    }
  rule.gantry_angle_offset_deg = section.number("gantry_angle_offset_deg", -360, 360).value_or(0.0);
  if (const auto plane = section.find<std::string>("spacing_plane", "SID or SAD")) {
    if (plane != "SID" && plane != "SAD") section.refuse("spacing_plane", "SID or SAD");
    rule.spacing_at_axis = plane == "SAD";
  }
  if (const auto offset = section.find<std::array<double, 2>>("receptor_offset_mm", "two numbers, x and y"))
    rule.receptor_offset_mm = Eigen::Vector2d(offset->data());
  rule.switches.assume_centered = section.find<bool>("assume_centered", "true or false").value_or(false);
  rule.switches.sad_mm = section.number("sad_mm", 1, 5000);
  rule.switches.sid_mm = section.number("sid_mm", 1, 5000);
  rule.switches.couch_angle_deg = section.number("couch_angle_deg", -360, 360);
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
    if (!rule.switches.sid_mm) throw Error(fmt::format("{}: sid_mm is missing, which pixel_from_room needs", where));
    if (rule.gantry_angle_offset_deg != 0.0 || rule.spacing_at_axis || !rule.receptor_offset_mm.isZero() ||
        rule.switches.assume_centered)
      throw Error(fmt::format("{}: pixel_from_room says where all pixels are; it goes with no other geometry", where));
  }
  section.end();
  return rule;
}

bool fits(const MachineProfile::Rule& rule, const RtImage& image) {
  return std::ranges::all_of(rule.where, [&](const auto& wanted) {
    const auto found = image.equipment.find(wanted.first);
    return found != image.equipment.end() && found->second == wanted.second;
  });
}

}  // namespace

MachineProfile read_machine_profile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string content{std::istreambuf_iterator<char>(file), {}};
  if (!file) throw Error(fmt::format("{}: cannot be read", path.string()));
  Json json;
  try {
    json = Json::parse(content);
  } catch (const Json::exception& error) {
    throw Error(fmt::format("{}: is no JSON: {}", path.string(), error.what()));
  }
  Section section(json, path.string());
  if (const int version = section.required<int>("machine_profile", "1, the version of its format"); version != 1)
    section.refuse("machine_profile", "1, the version of its format");
  MachineProfile profile{
      .path = path, .name = section.required<std::string>("name", "a text"), .sha256 = sha256_of(content)};
  const auto images = section.required<std::vector<Json>>("images", "a list of rules");
  for (std::size_t n = 0; n < images.size(); ++n) {
    const std::string where = fmt::format("{}: images[{}]", path.string(), n);
    profile.rules.push_back(rule_from(Section(images[n], where), where));
  }
  section.end();
  if (profile.rules.empty()) throw Error(fmt::format("{}: images is empty, expected a list of rules", path.string()));
  return profile;
}

RtImage with_machine(RtImage image, const MachineProfile& profile, Notes& notes) {
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
  if (rule->pixel_from_room) {
    if (image.columns != rule->columns || image.rows != rule->rows)
      throw Error(fmt::format("{}: has {} x {} pixels; the projection matrix of {} is for {} x {}", image.path.string(),
                              image.columns, image.rows, origin, rule->columns, rule->rows));
    image.pixel_from_room = rule->pixel_from_room;
    note("projection matrix supplied");
  }
  if (rule->gantry_angle_offset_deg != 0.0 && image.gantry_angle_deg) {
    *image.gantry_angle_deg += rule->gantry_angle_offset_deg;
    note(fmt::format("{} {:+} degrees", described(DCM_GantryAngle), rule->gantry_angle_offset_deg));
  }
  if (rule->spacing_at_axis && image.sad_mm && image.sid_mm) {
    const double magnified = *image.sid_mm / *image.sad_mm;
    if (image.pixel_spacing_mm) *image.pixel_spacing_mm *= magnified;
    if (image.position_mm) *image.position_mm *= magnified;
    note(fmt::format("{} brought from the axis to the receptor", described(DCM_ImagePlanePixelSpacing)));
  }
  if (!rule->receptor_offset_mm.isZero() && image.sad_mm && image.sid_mm) {
    if (!image.receptor_translation_mm) image.receptor_translation_mm = {0.0, 0.0, *image.sad_mm - *image.sid_mm};
    image.receptor_translation_mm->head<2>() += rule->receptor_offset_mm;
    note(fmt::format("{} moved by ({:.2f}) mm", described(DCM_XRayImageReceptorTranslation),
                     fmt::join(rule->receptor_offset_mm, ", ")));
  }
  return image;
}

}  // namespace isoshift
