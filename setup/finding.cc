#include "setup/finding.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "base/option_name.h"

namespace isoshift {
namespace {

constexpr std::array kNames = {
    std::pair(Check::kNotRun, "not_run"),
    std::pair(Check::kPoseWasSet, "pose_was_set"),
    std::pair(Check::kParameterAtBound, "parameter_at_bound"),
    std::pair(Check::kNotConverged, "not_converged"),
    std::pair(Check::kStartsEndApart, "starts_end_apart"),
    std::pair(Check::kOtherStartsEndApart, "other_starts_end_apart"),
    std::pair(Check::kMatchesWorseThanPlanned, "matches_worse_than_planned"),
    std::pair(Check::kPullsThePose, "pulls_the_pose"),
    std::pair(Check::kFieldIsNotSure, "field_is_not_sure"),
    std::pair(Check::kAllIsExcluded, "all_is_excluded"),
    std::pair(Check::kPartsMatchElsewhere, "parts_match_elsewhere"),
    std::pair(Check::kTooFewParts, "too_few_parts"),
    std::pair(Check::kMatch, "match"),
    std::pair(Check::kMatchOfView, "match_of_view"),
    std::pair(Check::kContradiction, "contradiction"),
    std::pair(Check::kViewsApart, "views_apart"),
    std::pair(Check::kTurnBetweenViews, "turn_between_views"),
    std::pair(Check::kUnobservable, "unobservable"),
    std::pair(Check::kUndetermined, "undetermined"),
    std::pair(Check::kUncertainTarget, "uncertain_target"),
    std::pair(Check::kUncertainAxis, "uncertain_axis"),
    std::pair(Check::kNoBone, "no_bone"),
    std::pair(Check::kTargetMatch, "target_match"),
    std::pair(Check::kUnconfirmedBone, "unconfirmed_bone"),
    std::pair(Check::kImageShare, "image_share"),
    std::pair(Check::kTargetIsBent, "target_is_bent"),
    std::pair(Check::kAlternativesNotCompared, "alternatives_not_compared"),
    std::pair(Check::kAlternativeMatchesBetter, "alternative_matches_better"),
    std::pair(Check::kAlternativeMatchesAsWell, "alternative_matches_as_well"),
    std::pair(Check::kTargetOutsideField, "target_outside_field"),
    std::pair(Check::kTargetAtEdgeOfField, "target_at_edge_of_field"),
    std::pair(Check::kTargetOutsideRectangle, "target_outside_rectangle"),
    std::pair(Check::kTargetAtEdgeOfRectangle, "target_at_edge_of_rectangle"),
    std::pair(Check::kRegionNotConfirmed, "region_not_confirmed"),
    std::pair(Check::kRegionContradicted, "region_contradicted"),
    std::pair(Check::kLargeRotation, "large_rotation"),
    std::pair(Check::kNoisyRenderer, "noisy_renderer"),
    std::pair(Check::kGpuDiffers, "gpu_differs"),
    std::pair(Check::kScoutWidth, "scout_width"),
    std::pair(Check::kScoutTurned, "scout_turned"),
    std::pair(Check::kTubeSide, "tube_side"),
    std::pair(Check::kFiles, "files"),
    std::pair(Check::kTarget, "target"),
    std::pair(Check::kRegion, "region"),
    std::pair(Check::kSurrogate, "surrogate"),
};

// The numbers of a finding. A file may hold fewer: then they are no numbers.
class Numbers {
 public:
  explicit Numbers(const Finding& finding) : finding_(finding) {}
  double operator[](std::size_t n) const { return at(n).value; }
  double limit(std::size_t n = 0) const { return at(n).limit; }
  const std::string& unit(std::size_t n = 0) const { return at(n).unit; }

 private:
  const Measure& at(std::size_t n) const {
    static const Measure none{.value = std::numeric_limits<double>::quiet_NaN(), .unit = ""};
    return n < finding_.measures.size() ? finding_.measures[n] : none;
  }
  const Finding& finding_;
};

std::string_view name_of(std::string_view unit) { return unit == "deg" ? "degrees" : unit; }

std::string views_contradict(std::string_view how) { return fmt::format("the views contradict each other: {}", how); }

std::string of_target_match(const Finding& finding) {
  const Numbers n(finding);
  const std::string measured =
      finding.measures.size() < 4
          ? fmt::format(
                "gradient correlation {:.3f} and of parts by themselves {:.3f}; {:.2f} and {:.3f} are "
                "expected, or {:.2f} of parts",
                n[0], n[1], n.limit(0), n.limit(1), n.limit(2))
          : fmt::format(
                "gradient correlation {:.3f}, {:.2f} is expected; or of parts by themselves {:.3f}, {:.2f} is "
                "expected; or of most pixels within 40 mm {:.3f} and within 20 mm {:.3f}, {:.2f} and {:.2f} "
                "are expected",
                n[0], n.limit(0), n[1], n.limit(1), n[2], n[3], n.limit(2), n.limit(3));
  return fmt::format(
      "the target's surroundings match poorly: they may have changed (metal, fluid, gas) or be another patient's, or "
      "the target may lie elsewhere ({})",
      measured);
}

}  // namespace

std::string_view to_string(Check check) {
  return std::ranges::find(kNames, check, &std::pair<Check, const char*>::first)->second;
}

std::optional<Check> check_from(std::string_view name) {
  for (const auto& [check, known] : kNames)
    if (name == known) return check;
  return std::nullopt;
}

std::string_view axis_of_room(std::size_t axis) {
  constexpr std::array kAxes = {"x translation",    "y translation",    "z translation",
                                "rotation about x", "rotation about y", "rotation about z"};
  return kAxes.at(axis);
}

// NOLINTNEXTLINE(readability-function-size): long because there are many checks, with a sentence each
std::string in_words(const Finding& finding) {
  const std::string& view = finding.view;
  const std::string& subject = finding.subject;
  const Numbers n(finding);
  switch (finding.check) {
    case Check::kNotRun: return "not run";
    case Check::kPoseWasSet: return "the pose was set, not searched";
    case Check::kParameterAtBound: return fmt::format("the {} ended at its bound", subject);
    case Check::kNotConverged: return "the last stage of the search did not converge";
    case Check::kStartsEndApart:
      return fmt::format("searches from different starts end {:.1f} mm and {:.1f} degrees apart in stage {}", n[0],
                         n[1], subject);
    case Check::kOtherStartsEndApart:
      return fmt::format("from another start the {} ends {:.1f} {} away", subject, n[0], name_of(n.unit()));
    case Check::kMatchesWorseThanPlanned:
      return fmt::format("{} matches worse than at the planned pose (similarity {:.4f}, was {:.4f})", view, n[0],
                         n.limit());
    case Check::kPullsThePose:
      return fmt::format("without {} the pose lies {:.1f} mm and {:.1f} degrees away", view, n[0], n[1]);
    case Check::kFieldIsNotSure: return fmt::format("the irradiated field of {} is not sure: {}", view, finding.words);
    case Check::kAllIsExcluded:
      return fmt::format("what is excluded covers nearly all that {} shows, and was compared nevertheless", view);
    case Check::kPartsMatchElsewhere:
      return fmt::format("{:.0f} of {:.0f} parts of {} match elsewhere: anatomy may have moved against the rest", n[0],
                         n[1], view);
    case Check::kTooFewParts:
      return fmt::format("too little of {} is compared to tell whether anatomy moved against the rest", view);
    case Check::kMatch: return fmt::format("the final gradient correlation {:.3f} is below {:.2f}", n[0], n.limit());
    case Check::kMatchOfView: return fmt::format("{} hardly matches (gradient correlation {:.3f})", view, n[0]);
    case Check::kContradiction:
      return views_contradict(fmt::format(
          "each of them alone would want the anatomy elsewhere, {:.1f} mm in the mean. The patient or anatomy may have "
          "moved between them or against the rest, or an angle, a distance or a position in a file may be wrong",
          n[0]));
    case Check::kViewsApart:
      return views_contradict(
          "a patient who lies elsewhere in each of them explains as much as bones that have moved. The patient may "
          "have moved between the images, or an angle, a distance or a position in a file may be wrong");
    case Check::kTurnBetweenViews:
      return views_contradict(
          fmt::format("each of them alone would want the patient turned, by {:.1f} degrees against the other. A gantry "
                      "angle in a file, or a projection matrix of a machine profile, may be wrong, or the patient may "
                      "have turned between the images",
                      n[0]));
    case Check::kUnobservable:
      return "all views look along nearly the same direction, along which nothing was measured";
    case Check::kUndetermined: return "the images do not determine the pose";
    case Check::kUncertainTarget:
      return fmt::format("the target is uncertain along {}: {:.1f} mm at two sigma", subject, n[0]);
    case Check::kUncertainAxis:
      return fmt::format("the {} is uncertain: {:.1f} {} at two sigma", subject, n[0], name_of(n.unit()));
    case Check::kNoBone: return "no bone was recognized within 20 mm of the target: X-rays do not show soft tissue";
    case Check::kTargetMatch: return of_target_match(finding);
    case Check::kUnconfirmedBone:
      return "the images determine no bone but the one that carries the target: nothing confirms where it lies";
    case Check::kImageShare:
      return fmt::format(
          "the images hardly show the bodies that carry the target: {:.0f} % of what is known of their place comes "
          "from them, the rest from their neighbors",
          100.0 * n[0]);
    case Check::kTargetIsBent:
      return fmt::format(
          "the target itself is bent: parts of its surface lie up to {:.1f} mm off when its center is right", n[0]);
    case Check::kAlternativesNotCompared:
      return "the preset leaves out the check for mirrored, turned and exchanged images";
    case Check::kAlternativeMatchesBetter:
      return fmt::format("with {} the images match better ({:.3f}; as they are {:.3f})", subject, n[0], n[1]);
    case Check::kAlternativeMatchesAsWell:
      return fmt::format(
          "with {} the images match as well ({:.3f}; as they are {:.3f}), {:.1f} mm and {:.1f} degrees away", subject,
          n[0], n[1], n[2], n[3]);
    case Check::kTargetOutsideField:
      return fmt::format("{} does not show the target: its center lies outside of the field", view);
    case Check::kTargetAtEdgeOfField:
      return fmt::format(
          "{} shows the target {:.0f} mm from the edge of the field: what surrounds it is not seen ({:.0f} mm are "
          "expected)",
          view, n[0], n.limit());
    case Check::kTargetOutsideRectangle:
      return fmt::format("the rectangle of {} does not hold the target: its center lies {:.0f} mm outside", view, n[0]);
    case Check::kTargetAtEdgeOfRectangle:
      return fmt::format(
          "the rectangle of {} ends {:.0f} mm from the target's center: what surrounds it is not compared ({:.0f} mm "
          "are expected)",
          view, n[0], n.limit());
    case Check::kRegionNotConfirmed:
      return fmt::format(
          "the X-rays show too little within {:.0f} mm of the target to confirm what the chosen region says", n[0]);
    case Check::kRegionContradicted:
      return fmt::format(
          "what the X-rays show within {:.0f} mm of the target puts it {:.1f} mm elsewhere: anatomy in the chosen "
          "region may have moved against it. A smaller region may tell, or none",
          n[1], n[0]);
    case Check::kLargeRotation:
      return fmt::format(
          "the couch would have to turn by {:.1f} degrees ({}), more than {:.0f} degrees about one axis: the patient "
          "may lie otherwise than planned, or an angle in a file may be on another scale. Look at both; an action "
          "level with rotation_deg in a site file ({}) says from which rotation to act",
          n[0], subject, n.limit(), option("site", "FILE"));
    case Check::kNoisyRenderer:
      return fmt::format("the DRRs of {} are too noisy for the last stage of the search", subject);
    case Check::kScoutWidth:
      return fmt::format(
          "across the table the scout shows the CT {:.3f} times as wide as spacing and distances say: one of them may "
          "be wrong, or the plane of the image is not that of the gantry's axis",
          n[0]);
    case Check::kScoutTurned:
      return fmt::format(
          "the patient would have turned by {:.1f} degrees about the table's direction; a central ray {:.0f} mm beside "
          "the middle of the rows looks the same: has the scout been cut?",
          n[0], n[1]);
    case Check::kTubeSide:
      return fmt::format("with the tube on the {} side the scout matches {} ({:.3f}; from the other side {:.3f})",
                         subject, n[1] < n[0] ? "better" : "as well", n[0], n[1]);
    case Check::kGpuDiffers:
    case Check::kFiles:
    case Check::kTarget:
    case Check::kRegion:
    case Check::kSurrogate: return finding.words;
  }
  return "";
}

std::vector<std::string> in_words(std::span<const Finding> findings) {
  std::vector<std::string> sentences;
  sentences.reserve(findings.size());
  for (const Finding& finding : findings) sentences.push_back(in_words(finding));
  return sentences;
}

Verdict verdict_of(std::span<const Finding> findings) {
  Verdict worst = Verdict::kAccepted;
  for (const Finding& finding : findings) worst = std::max(worst, finding.consequence);
  return worst;
}

}  // namespace isoshift
