#include "registration/quality/findings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "geometry/rotation.h"
#include "registration/pose_parameters.h"
#include "registration/quality/limits.h"

namespace isoshift {
namespace {

constexpr double kMinViewSeparationRad = rad_from_deg(29.9);  // 30 degrees, as files round them

using Findings = std::vector<Finding>;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Of the parts of a view.
double parts_that_may_disagree(int parts, bool is_volume_chosen) {
  const double allowed = is_volume_chosen
                             ? limits::kMostPartsShareOfVolume * parts
                             : std::min(limits::kMostPartsShare * parts,
                                        std::max(limits::kMostParts, limits::kMostPartsShareOfMany * parts));
  return std::max(1.0, allowed);
}

Measure in_mm(double value_mm, double limit_mm) { return {.value = value_mm, .limit = limit_mm, .unit = "mm"}; }

Measure in_deg(double value_rad, double limit_rad) {
  return {.value = deg_from_rad(value_rad), .limit = deg_from_rad(limit_rad), .unit = "deg"};
}

Measure as_number(double value, double limit = kNone) { return {.value = value, .limit = limit, .unit = ""}; }

void check_search(std::span<const double> parameters, const RegistrationOptions& options,
                  const RegistrationResult& result, Findings& findings) {
  if (!options.is_searched) {
    findings.push_back({.check = Check::kPoseWasSet});
    return;
  }
  for (std::size_t axis = 0; axis < parameters.size(); ++axis) {
    const double bound = axis < 3 ? options.bound_mm : options.bound_rad * kLeverMm;
    if (std::abs(parameters[axis]) >= limits::kAtBoundShare * bound)
      findings.push_back({.check = Check::kParameterAtBound,
                          .subject = std::string(axis_of_room(axis)),
                          .measures = {axis < 3 ? in_mm(parameters[axis], bound)
                                                : in_deg(parameters[axis] / kLeverMm, bound / kLeverMm)}});
  }
  if (result.stages.empty() || result.stages.back().reached_limit) findings.push_back({.check = Check::kNotConverged});
  // Of the whole, if bodies answered: they went on from one of its poses.
  for (const StageReport& stage : result.stages)
    if (result.bodies.empty() && stage.spread_mm &&
        (*stage.spread_mm > limits::kMaxSpreadMm || *stage.spread_rad > limits::kMaxSpreadRad))
      findings.push_back({.check = Check::kStartsEndApart,
                          .subject = stage.name,
                          .measures = {in_mm(*stage.spread_mm, limits::kMaxSpreadMm),
                                       in_deg(*stage.spread_rad, limits::kMaxSpreadRad)}});
}

void check_parts(const ViewConsistency& parts, const std::string& name, bool is_volume_chosen, Findings& findings) {
  const int with_signal = parts.with_signal(), disagreeing = parts.disagreeing();
  const double allowed = parts_that_may_disagree(with_signal, is_volume_chosen);
  if (disagreeing > allowed)
    findings.push_back({.check = Check::kPartsMatchElsewhere,
                        .view = name,
                        .measures = {as_number(disagreeing, allowed), as_number(with_signal)}});
  if (with_signal < limits::kLeastParts)
    findings.push_back(
        {.check = Check::kTooFewParts, .view = name, .measures = {as_number(with_signal, limits::kLeastParts)}});
}

void check_views(bool is_volume_chosen, const RegistrationResult& result, Findings& findings) {
  double mean = 0.0;
  for (std::size_t n = 0; n < result.views.size(); ++n) {
    const ViewMatch& view = result.views[n];
    const std::string name = name_of_view(view.label, n);
    mean += view.similarity_final / static_cast<double>(result.views.size());
    if (!(view.similarity_final >= view.similarity_start - limits::kSimilarityNoise))
      findings.push_back({.check = Check::kMatchesWorseThanPlanned,
                          .view = name,
                          .measures = {as_number(view.similarity_final, view.similarity_start)}});
    if (view.left_out &&
        (view.left_out->distance_mm > limits::kMaxSpreadMm || view.left_out->angle_rad > limits::kMaxSpreadRad))
      findings.push_back({.check = Check::kPullsThePose,
                          .view = name,
                          .measures = {in_mm(view.left_out->distance_mm, limits::kMaxSpreadMm),
                                       in_deg(view.left_out->angle_rad, limits::kMaxSpreadRad)}});
    if (!view.field.is_sure())
      findings.push_back({.check = Check::kFieldIsNotSure, .view = name, .words = view.field.doubt});
    if (!view.has_all_excluded) findings.push_back({.check = Check::kAllIsExcluded, .view = name});
    // Where bodies answered, the parts of the whole did not agree.
    if (result.bodies.empty()) check_parts(view.consistency, name, is_volume_chosen, findings);
  }
  if (!(mean >= limits::kMinSimilarity)) {
    findings.push_back({.check = Check::kMatch,
                        .consequence = mean >= limits::kRejectedSimilarity ? Verdict::kReview : Verdict::kRejected,
                        .measures = {as_number(mean, limits::kMinSimilarity)}});
  } else {
    for (std::size_t n = 0; n < result.views.size(); ++n)
      if (const ViewMatch& view = result.views[n]; !(view.similarity_final >= limits::kMinViewSimilarity))
        findings.push_back({.check = Check::kMatchOfView,
                            .view = name_of_view(view.label, n),
                            .measures = {as_number(view.similarity_final, limits::kMinViewSimilarity)}});
  }
}

void check_contradiction(const RegistrationResult& result, Findings& findings) {
  double squares = 0.0, variances = 0.0;
  for (const ViewMatch& view : result.views) {
    const Contradiction contradiction = view.contradiction.value_or(Contradiction());
    squares += contradiction.mm * contradiction.mm / static_cast<double>(result.views.size());
    variances += contradiction.sigma_mm * contradiction.sigma_mm / static_cast<double>(result.views.size());
  }
  const double limit_mm = std::max(limits::kMaxContradictionMm, limits::kMaxContradictionSigmas * std::sqrt(variances));
  if (!(std::sqrt(squares) <= limit_mm))
    findings.push_back({.check = Check::kContradiction, .measures = {in_mm(std::sqrt(squares), limit_mm)}});
  else if (result.apart && result.apart->is_clear())
    findings.push_back({.check = Check::kViewsApart,
                        .measures = {as_number(result.apart->share_of_bodies_gain, limits::kMostShareApart),
                                     {.value = result.apart->gain, .limit = limits::kLeastGainApart, .unit = "nat"}}});
  else if (result.turn.is_clear() && !(result.turn.share_of_bodies_gain.value_or(1.0) <= limits::kMostByTurn))
    findings.push_back(
        {.check = Check::kTurnBetweenViews, .measures = {in_deg(result.turn.angle_rad, limits::kMostTurnRad)}});
}

// Whether vertebrae carry the target.
bool is_by_vertebrae(const RegistrationResult& result) {
  double share = 0.0;
  for (const BodyMotion& body : result.bodies)
    if (body.vertebra) share += body.carries_target;
  return share >= limits::kLeastByVertebrae;
}

// Coarse pixels tell right from wrong where noise and coarse images count least; contrast that has changed spoils them.
// Most of the fine pixels tell in spite of that, where vertebrae carry the target.
bool does_target_match(const TargetMatch& match, bool by_vertebrae) {
  if (!by_vertebrae)
    return match.of_parts >= limits::kLeastOfParts ||
           (match.of_all >= limits::kLeastOfAll && match.of_parts >= limits::kLeastOfPartsOfGroups);
  return match.of_all >= limits::kLeastOfAll ||
         (match.of_parts >= limits::kLeastOfParts &&
          match.of_most_within_40_mm >= limits::kLeastWithin40MmBesideParts) ||
         (match.of_most_within_40_mm >= limits::kLeastWithin40Mm &&
          match.of_most_within_20_mm >= limits::kLeastWithin20Mm);
}

std::vector<Measure> measures_of(const TargetMatch& match, bool by_vertebrae) {
  if (!by_vertebrae)
    return {as_number(match.of_all, limits::kLeastOfAll), as_number(match.of_parts, limits::kLeastOfPartsOfGroups),
            as_number(match.of_parts, limits::kLeastOfParts)};
  return {as_number(match.of_all, limits::kLeastOfAll), as_number(match.of_parts, limits::kLeastOfParts),
          as_number(match.of_most_within_40_mm, limits::kLeastWithin40Mm),
          as_number(match.of_most_within_20_mm, limits::kLeastWithin20Mm)};
}

// The answer is that of the bodies that carry the target: they must be seen, and the target must not be bent itself.
void check_bodies(const RegistrationResult& result, Findings& findings) {
  const bool by_vertebrae = is_by_vertebrae(result);
  if (!does_target_match(result.target_match, by_vertebrae))
    findings.push_back({.check = Check::kTargetMatch, .measures = measures_of(result.target_match, by_vertebrae)});
  const auto determined = std::ranges::count_if(result.bodies, &BodyMotion::is_determined);
  if (determined < limits::kMinDeterminedBones)
    findings.push_back({.check = Check::kUnconfirmedBone,
                        .measures = {as_number(static_cast<double>(determined), limits::kMinDeterminedBones)}});
  if (!(result.target_image_share >= limits::kMinImageShare))
    findings.push_back(
        {.check = Check::kImageShare, .measures = {as_number(result.target_image_share, limits::kMinImageShare)}});
  if (!(result.target_deformation_mm <= limits::kMaxDeformationMm))
    findings.push_back(
        {.check = Check::kTargetIsBent, .measures = {in_mm(result.target_deformation_mm, limits::kMaxDeformationMm)}});
}

void check_uncertainty(const Eigen::Vector3d& target_room_mm, const RegistrationResult& result, Findings& findings) {
  const double most_rad = result.bodies.empty() ? limits::kMaxTwoSigmaRad : limits::kMaxTwoSigmaRadOfBodies;
  if (!result.uncertainty) {
    findings.push_back({.check = Check::kUndetermined});
    return;
  }
  const Eigen::Vector3d two_sigma_mm = 2.0 * result.uncertainty->sigma_at_mm(target_room_mm);
  const Eigen::Vector3d two_sigma_rad = 2.0 * result.uncertainty->sigma_rotation_rad();
  for (int axis = 0; axis < 3; ++axis) {
    if (!(two_sigma_mm[axis] <= limits::kMaxTwoSigmaMm))
      findings.push_back({.check = Check::kUncertainTarget,
                          .subject = std::string(1, "xyz"[axis]),
                          .measures = {in_mm(two_sigma_mm[axis], limits::kMaxTwoSigmaMm)}});
    if (!(two_sigma_rad[axis] <= most_rad))
      findings.push_back({.check = Check::kUncertainAxis,
                          .subject = std::string(axis_of_room(static_cast<std::size_t>(axis) + 3)),
                          .measures = {in_deg(two_sigma_rad[axis], most_rad)}});
  }
}

void check_alternatives(const RegistrationResult& result, Findings& findings) {
  for (const Alternative& alternative : result.alternatives) {
    if (alternative.is_ruled_out) continue;
    const double as_is = 1.0 - alternative.as_is, as_other = 1.0 - alternative.similarity;
    const std::vector<Measure> measures = {
        as_number(alternative.similarity, 1.0 - limits::kAlternativeMargin * as_is), as_number(alternative.as_is),
        in_mm(alternative.distance_mm, limits::kMaxSpreadMm), in_deg(alternative.angle_rad, limits::kMaxSpreadRad)};
    if (as_other * limits::kAlternativeMargin <= as_is)
      findings.push_back({.check = Check::kAlternativeMatchesBetter,
                          .subject = alternative.description,
                          .measures = {measures[0], measures[1]}});
    // A ball, for one, looks the same from both sides: that is harmless where it means the same pose.
    else if (!(as_other >= limits::kAlternativeMargin * as_is) &&
             (alternative.distance_mm > limits::kMaxSpreadMm || alternative.angle_rad > limits::kMaxSpreadRad))
      findings.push_back(
          {.check = Check::kAlternativeMatchesAsWell, .subject = alternative.description, .measures = measures});
  }
}

}  // namespace

std::vector<Eigen::Vector3d> unobservable_directions(std::span<const XrayView> views) {
  // Opposed views see the same two axes: directions count without their sign.
  double largest_separation_rad = 0.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const XrayView& view : views) {
    const Eigen::Vector3d direction = view.central_direction_room();
    for (const XrayView& other : views)
      largest_separation_rad = std::max(
          largest_separation_rad, std::acos(std::min(1.0, std::abs(direction.dot(other.central_direction_room())))));
    sum += direction.dot(views.front().central_direction_room()) < 0.0 ? Eigen::Vector3d(-direction) : direction;
  }
  if (largest_separation_rad >= kMinViewSeparationRad) return {};
  return {sum.normalized()};
}

Eigen::Vector3d target_found_room_mm(const RegistrationOptions& options, const RegistrationResult& result) {
  if (!options.target_patient_mm) return Eigen::Vector3d::Zero();
  return result.actual_room_from_patient * *options.target_patient_mm;
}

std::vector<Finding> findings_about(std::span<const double> parameters, const RegistrationOptions& options,
                                    const RegistrationResult& result) {
  Findings findings;
  check_search(parameters, options, result, findings);
  check_views(options.region != nullptr && options.region->has_volume(), result, findings);
  check_contradiction(result, findings);
  check_uncertainty(target_found_room_mm(options, result), result, findings);
  if (!result.bodies.empty()) check_bodies(result, findings);
  check_alternatives(result, findings);
  if (options.is_searched && !options.check_alternatives)
    findings.push_back({.check = Check::kAlternativesNotCompared});
  // On the phantom of the demo, where ray casters end 0.1 mm beside the truth, splatting ended 1.4 mm beside it: its
  // noise belongs to the voxels, moves with them, and carries its own gradients into the last stage.
  if (const auto kind = renderer_kind_from(result.renderer); kind && is_splatting(*kind))
    findings.push_back({.check = Check::kNoisyRenderer, .subject = result.renderer});
  if (!result.unobservable_room.empty()) findings.push_back({.check = Check::kUnobservable});
  return findings;
}

}  // namespace isoshift
