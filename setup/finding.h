#pragma once
// What the checks of a registration found, as data. The verdict follows from it, and words are made of it where it is
// shown.

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "setup/verdict.h"

namespace isoshift {

// What was asked. to_string() gives the name that result.json has.
enum class Check {
  kNotRun,  // nothing was registered
  // Of the search.
  kPoseWasSet,
  kParameterAtBound,
  kNotConverged,
  kStartsEndApart,
  kOtherStartsEndApart,
  // Of each view.
  kMatchesWorseThanPlanned,
  kPullsThePose,
  kFieldIsNotSure,
  kAllIsExcluded,
  kPartsMatchElsewhere,
  kTooFewParts,
  kMatch,
  kMatchOfView,
  // Of the views together.
  kContradiction,
  kViewsApart,
  kTurnBetweenViews,
  kUnobservable,
  // Of the uncertainty.
  kUndetermined,
  kUncertainTarget,
  kUncertainAxis,
  // Of bodies.
  kNoBone,
  kTargetMatch,
  kUnconfirmedBone,
  kImageShare,
  kTargetIsBent,
  // Of what the images may be instead.
  kAlternativesNotCompared,
  kAlternativeMatchesBetter,
  kAlternativeMatchesAsWell,
  // Of the target, and of what was chosen to be compared.
  kTargetOutsideField,
  kTargetAtEdgeOfField,
  kTargetOutsideRectangle,
  kTargetAtEdgeOfRectangle,
  kRegionNotConfirmed,
  kRegionContradicted,
  // Of the answer.
  kLargeRotation,
  // Of what rendered.
  kNoisyRenderer,
  kGpuDiffers,
  // Of a CT scout.
  kScoutWidth,
  kScoutTurned,
  kTubeSide,
  // Of files and of what they draw: Finding::words says what.
  kFiles,
  kTarget,
  kRegion,
  kSurrogate,
};

std::string_view to_string(Check check);
std::optional<Check> check_from(std::string_view name);

// A number that a check compares: with its limit, or beside one that has it.
struct Measure {
  double value = 0.0;
  double limit = std::numeric_limits<double>::quiet_NaN();
  std::string unit;  // "mm", "deg"; empty: a share, a correlation or a count
};

// What speaks against a result.
struct Finding {
  Check check = Check::kNotRun;
  Verdict consequence = Verdict::kReview;
  std::string view;               // which view it is about (name_of_view()); empty: all of them
  std::string subject;            // what else it is about: an axis, a stage, an alternative, a renderer
  std::vector<Measure> measures;  // what decides comes first
  std::string words;              // where numbers do not say it: what was found in files, or of a field
};

// For people: one sentence, without a full stop.
std::string in_words(const Finding& finding);
std::vector<std::string> in_words(std::span<const Finding> findings);

// The worst consequence; accepted without any finding.
Verdict verdict_of(std::span<const Finding> findings);

// The six parameters of a pose in the room.
std::string_view axis_of_room(std::size_t axis);

}  // namespace isoshift
