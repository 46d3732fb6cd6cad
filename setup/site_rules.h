#pragma once
// What a site decided about its results: from which setup error a person must act, which motions its couch can make,
// and which scale the couch's display uses.

#include <optional>
#include <string>

#include "setup/couch_scale.h"
#include "setup/couch_shift.h"

namespace isoshift {

enum class LengthUnit { kMm, kCm };

// The setup error from which a person must act. At least one limit is set.
struct ActionLevel {
  std::optional<double> translation_mm;  // along any axis
  std::optional<double> vector_mm;       // length of the translation
  std::optional<double> rotation_deg;    // about any axis
};

// How far a known position or move of a phantom may be mistaken, along and about any axis
// (docs/commands/commission.md).
struct LocalizationLimits {
  double translation_mm = 0.0;
  double rotation_deg = 0.0;
};

// The scale of the couch's display, and who compared this scale with the couch.
struct ValidatedScale {
  CouchScale scale = CouchScale::kIec61217;
  std::string validated_by, validated_on;  // the day as YYYY-MM-DD
};

// Who allowed that accepted results are released without a person, and when.
struct AutomaticRelease {
  std::string by, on;
};

// What holds for the result of one anatomy.
struct SiteRules {
  std::string name, sha256;  // of the site's file
  std::string anatomy;       // whose action level it is
  std::string target;        // of the anatomy: the name of a structure, or "isocenter"; empty: the plan names it
  std::string surrogate;     // the structure whose bones carry the target; empty: bones near it
  std::optional<ActionLevel> level;  // unset: none
  CouchDof couch_dof = CouchDof::kSix;
  std::optional<ValidatedScale> couch_scale;  // shown beside IEC 61217
  LengthUnit length_unit = LengthUnit::kMm;
  std::optional<AutomaticRelease> automatic_release;
};

}  // namespace isoshift
