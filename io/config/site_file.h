#pragma once
// What a site decided about its results: a JSON file (docs/site-file.md).

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "setup/site_rules.h"

namespace isoshift {

constexpr double kMaxTimeSpanS = 600.0;        // between the views of one session
constexpr double kDefaultUntoldSpanS = 120.0;  // between those without table read-outs, where no site file says other

using NameByAnatomy = std::map<std::string, std::string, std::less<>>;

struct SiteFile {
  // When a session of X-rays is complete.
  struct Sessions {
    int views = 2;                             // this number of X-rays has arrived,
    double quiet_s = 0.0;                      // and nothing of the patient has arrived for this time
    double max_span_s = kDefaultUntoldSpanS;   // between X-rays without table read-outs, or the result needs a review
    std::optional<double> max_clock_offset_s;  // of imagers from this computer, or watch says so
  };

  std::filesystem::path path;
  std::string name;
  std::string sha256;                                             // of the file, hexadecimal
  std::map<std::string, ActionLevel, std::less<>> action_levels;  // by anatomy; "default" where none is named
  NameByAnatomy targets;                                          // by anatomy: the name of a structure, or "isocenter"
  NameByAnatomy surrogates;                                       // by anatomy: the structure whose bones carry it
  CouchDof couch_dof = CouchDof::kSix;
  std::optional<ValidatedScale> couch_scale;  // shown beside IEC 61217
  LengthUnit length_unit = LengthUnit::kMm;
  std::optional<Sessions> sessions;
  std::optional<LocalizationLimits> localization_limits;  // for commission
  std::optional<AutomaticRelease> automatic_release;  // who allowed it, and when; unset: a person releases every result
};

// Throws Error naming the file, the place in it and what is expected there.
SiteFile read_site_file(const std::filesystem::path& path);

// The action level of an anatomy. If `anatomy` is empty: the level "default", or nothing if the file has no such level.
// Throws UsageError, with the names in the file, for any other anatomy of which the file has no action level, target or
// surrogate.
std::optional<ActionLevel> action_level(const SiteFile& site, std::string_view anatomy);

// The target of an anatomy, or else that of "default"; empty if the file names none.
std::string target_named(const SiteFile& site, std::string_view anatomy);

// The same of the structure whose bones carry the target.
std::string surrogate_named(const SiteFile& site, std::string_view anatomy);

}  // namespace isoshift
