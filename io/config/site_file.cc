#include "io/config/site_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>

#include "base/error.h"
#include "base/json_file.h"
#include "base/option_name.h"
#include "base/pattern.h"
#include "io/config/config_folder.h"

namespace isoshift {
namespace {

std::string required_day(JsonSection& section, const char* key) {
  constexpr const char* kExpected = "a day as YYYY-MM-DD";
  static const Pattern day("[0-9]{4}-(0[1-9]|1[0-2])-(0[1-9]|[12][0-9]|3[01])");
  std::string text = section.required<std::string>(key, kExpected);
  if (!day.matches(text)) section.refuse(key, kExpected);
  return text;
}

ActionLevel level_from(JsonSection section) {
  constexpr double kMaxMm = 100.0, kMaxDeg = 45.0;
  const ActionLevel level{.translation_mm = section.number("translation_mm", 0.0, kMaxMm),
                          .vector_mm = section.number("vector_mm", 0.0, kMaxMm),
                          .rotation_deg = section.number("rotation_deg", 0.0, kMaxDeg)};
  section.end();
  if (!level.translation_mm && !level.vector_mm && !level.rotation_deg)
    throw Error(fmt::format("{}: is empty, expected translation_mm, vector_mm or rotation_deg", section.where()));
  return level;
}

ValidatedScale scale_from(JsonSection section) {
  constexpr const char* kExpected = "\"IEC 61217\", \"Varian IEC\" or \"Varian Standard\"";
  const auto scale = couch_scale_from(section.required<std::string>("name", kExpected));
  if (!scale) section.refuse("name", kExpected);
  ValidatedScale result{.scale = *scale,
                        .validated_by = ConfigFolder::text(section, "validated_by", "who compared it with the couch"),
                        .validated_on = required_day(section, "validated_on")};
  section.end();
  return result;
}

void read_couch(JsonSection section, SiteFile& site) {
  constexpr const char* kExpected = "3, 4 or 6";
  switch (section.find<int>("degrees_of_freedom", kExpected).value_or(6)) {
    case 3: site.couch_dof = CouchDof::kThree; break;
    case 4: site.couch_dof = CouchDof::kFour; break;
    case 6: site.couch_dof = CouchDof::kSix; break;
    default: section.refuse("degrees_of_freedom", kExpected);
  }
  if (auto scale = section.section("scale")) site.couch_scale = scale_from(std::move(*scale));
  section.end();
}

std::optional<AutomaticRelease> release_from(JsonSection section) {
  constexpr const char* kExpected = "\"manual\" or \"automatic\"";
  const auto rule = section.required<std::string>("rule", kExpected);
  if (rule != "manual" && rule != "automatic") section.refuse("rule", kExpected);
  std::optional<AutomaticRelease> release;
  if (rule == "automatic")
    release = {.by = ConfigFolder::text(section, "by", "who allowed it"), .on = required_day(section, "on")};
  section.end();
  return release;
}

SiteFile::Sessions sessions_from(JsonSection section) {
  constexpr const char* kViews = "1 to 20 X-rays";
  constexpr double kLongestS = 3600.0;
  SiteFile::Sessions sessions{.views = section.required<int>("views", kViews)};
  if (sessions.views < 1 || sessions.views > 20) section.refuse("views", kViews);
  const auto quiet_s = section.number("quiet_s", 0.0, kLongestS);
  if (!quiet_s) section.refuse_missing("quiet_s", "seconds");
  sessions.quiet_s = *quiet_s;
  sessions.max_span_s = section.number("max_span_s", 0.0, kMaxTimeSpanS).value_or(sessions.max_span_s);
  sessions.max_clock_offset_s = section.number("max_clock_offset_s", 1.0, kLongestS);
  section.end();
  return sessions;
}

LocalizationLimits limits_from(JsonSection section) {
  constexpr double kMaxMm = 10.0, kMaxDeg = 5.0;
  const auto translation_mm = section.number("translation_mm", 0.0, kMaxMm);
  const auto rotation_deg = section.number("rotation_deg", 0.0, kMaxDeg);
  if (!translation_mm) section.refuse_missing("translation_mm", "mm, along any axis");
  if (!rotation_deg) section.refuse_missing("rotation_deg", "degrees, about any axis");
  section.end();
  return {.translation_mm = *translation_mm, .rotation_deg = *rotation_deg};
}

// Of an object with a name per anatomy; empty if the file has none.
NameByAnatomy names_by_anatomy(JsonSection& section, const char* key, const char* expected) {
  NameByAnatomy names;
  const auto named = section.section(key);
  if (!named) return names;
  using Names = std::map<std::string, std::string>;
  for (const auto& [anatomy, name] : section.required<Names>(key, "an object of structure names by anatomy")) {
    if (name.find_first_not_of(' ') == std::string::npos)
      throw Error(fmt::format("{}: {} is empty, expected {}", named->where(), anatomy, expected));
    names.emplace(anatomy, name);
  }
  return names;
}

// Of an anatomy, or else of "default".
std::string name_for(const NameByAnatomy& names, std::string_view anatomy) {
  for (const std::string_view whose : {anatomy, std::string_view("default")})
    if (const auto name = names.find(whose); name != names.end()) return name->second;
  return "";
}

}  // namespace

SiteFile read_site_file(const std::filesystem::path& path) {
  const JsonFile file = read_json_file(path);
  JsonSection section(file.json, path.string());
  constexpr const char* kVersion = "1, the version of its format";
  if (section.required<int>("site_file", kVersion) != 1) section.refuse("site_file", kVersion);
  SiteFile site{.path = path, .name = ConfigFolder::text(section, "name", "a text"), .sha256 = file.sha256};
  if (const auto levels = section.section("action_levels")) {
    using Levels = std::map<std::string, nlohmann::json>;
    for (const auto& [anatomy, json] : section.required<Levels>("action_levels", "an object of levels by anatomy"))
      site.action_levels.emplace(anatomy,
                                 level_from(JsonSection(json, fmt::format("{}: {}", levels->where(), anatomy))));
  }
  site.targets = names_by_anatomy(section, "targets", "the name of a structure, or isocenter");
  site.surrogates = names_by_anatomy(section, "surrogates", "the name of a structure");
  if (auto couch = section.section("couch")) read_couch(std::move(*couch), site);
  if (const auto unit = section.find<std::string>("length_unit", "mm or cm")) {
    if (unit != "mm" && unit != "cm") section.refuse("length_unit", "mm or cm");
    site.length_unit = unit == "mm" ? LengthUnit::kMm : LengthUnit::kCm;
  }
  if (auto sessions = section.section("sessions")) site.sessions = sessions_from(std::move(*sessions));
  if (auto limits = section.section("localization_limits")) site.localization_limits = limits_from(std::move(*limits));
  if (auto release = section.section("release")) site.automatic_release = release_from(std::move(*release));
  section.end();
  return site;
}

std::optional<ActionLevel> action_level(const SiteFile& site, std::string_view anatomy) {
  const auto level = site.action_levels.find(anatomy.empty() ? "default" : anatomy);
  if (level != site.action_levels.end()) return level->second;
  if (anatomy.empty() || site.targets.contains(anatomy) || site.surrogates.contains(anatomy)) return std::nullopt;
  std::set<std::string> names;
  for (const auto& [name, unused] : site.action_levels) names.insert(name);
  for (const NameByAnatomy* named : {&site.targets, &site.surrogates})
    for (const auto& [name, unused] : *named) names.insert(name);
  throw UsageError(fmt::format(
      "{}: site file \"{}\" has this anatomy neither in action_levels nor in targets or surrogates. It has: {}",
      option("anatomy", anatomy), site.name, names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "))));
}

std::string target_named(const SiteFile& site, std::string_view anatomy) { return name_for(site.targets, anatomy); }

std::string surrogate_named(const SiteFile& site, std::string_view anatomy) {
  return name_for(site.surrogates, anatomy);
}

}  // namespace isoshift
