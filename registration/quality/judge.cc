#include "registration/quality/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "geometry/rotation.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

constexpr double kMinViewSeparationRad = rad_from_deg(29.9);  // 30 degrees, as files round them
constexpr double kAtBoundShare = 0.99;
// A patient exactly on plan may lose a little: noise. On phantoms and real data less than 0.001 was lost.
constexpr double kSimilarityNoise = 0.005;
// Of gradient correlation, mean over the views. Right patients reached 0.63 to 0.98 on real data and phantoms, other
// patients 0.2 to 0.5 where the anatomy differed.
constexpr double kMinSimilarity = 0.5, kRejectedSimilarity = 0.35;
constexpr double kMinViewSimilarity = 0.4;  // of each view; those of a chosen spine reached 0.55
constexpr double kMaxSpreadMm = 1.0, kMaxSpreadRad = rad_from_deg(1.0);
// Root mean square over the views. Undisturbed studies reached 0.05 to 0.22 mm (plastic head and chest, four kinds of
// views); a patient turned 2 degrees between the views, a gantry 2 or a receptor 1.5 degrees, a panel 3 mm or a
// distance 2 % off in one of them 0.68 mm and more (docs/evaluation.md).
constexpr double kMaxContradictionMm = 0.5, kMaxContradictionSigmas = 3.0;
// Right patients of the campaign whose breathing looked like a turn: turned views explained at most 0.18 of what bodies
// did; gantry angles that were 2 or 3 degrees wrong 0.47 and more.
constexpr double kMostByTurn = 0.3;
constexpr double kMaxTwoSigmaMm = 1.0, kMaxTwoSigmaRad = rad_from_deg(1.0);
// Other patients of the same kind, whose bones were free to follow, had at most 0.85 of all and 0.95 of parts, and 0.87
// within 40 mm; real spines searched a vertebra off 0.76 within 40 mm (docs/algorithms.md, "Bodies that bend").
constexpr double kLeastOfAll = 0.86, kLeastOfParts = 0.95, kLeastWithin40Mm = 0.9, kLeastWithin20Mm = 0.7;
constexpr double kLeastByVertebrae = 0.8;
// Of vertebrae whose parts match: right chests had 0.84 and more, those searched a vertebra off at most 0.76, and a
// spinous process beside the end of the CT, found 2.3 mm off, 0.79.
constexpr double kLeastWithin40MmBesideParts = 0.8;
// Other bones are searched in groups, and a part of one may have moved by itself. Targets on opened jaws, 2 to 6 mm off
// at the edge of a field, had 0.86 to 0.88 of all and 0.82 to 0.93 of parts; right ones on jaws 0.87 to 0.91 and 0.94
// to 0.96, plastic heads 0.98 and 0.99.
constexpr double kLeastOfPartsOfGroups = 0.935;
constexpr std::ptrdiff_t kMinDeterminedBones = 2;
constexpr double kMinImageShare = 0.3, kMaxDeformationMm = 2.0;
// What carries a target is small, and turns less surely than a whole patient; what counts is where its surface lies.
constexpr double kMaxTwoSigmaRadOfBodies = rad_from_deg(2.0);
// An alternative must leave this much more unexplained (1 - gradient correlation) than the images as they are. On head
// phantoms, which are nearly symmetric, a mirrored AP view leaves 1.2 to 4 times as much.
constexpr double kAlternativeMargin = 1.1;
constexpr std::array kAxes = {"x translation",    "y translation",    "z translation",
                              "rotation about x", "rotation about y", "rotation about z"};

// Of the parts of a view. Right patients reached 3 of 77; others with skulls alike within a millimeter had 3 % of 150
// and more. Parts overlap, so that one place counts up to four times. What lies before and behind a chosen volume is
// seen in the X-ray only: there right ones reached 10 %.
double parts_that_may_disagree(int parts, bool is_volume_chosen) {
  const double allowed = is_volume_chosen ? 0.15 * parts : std::min(0.06 * parts, std::max(3.0, 0.03 * parts));
  return std::max(1.0, allowed);
}

void review(RegistrationResult& result, std::string reason) { result.demote(Verdict::kReview, std::move(reason)); }

void judge_search(std::span<const double> parameters, const RegistrationOptions& options, RegistrationResult& result) {
  if (!options.is_searched) {
    review(result, "the pose was set, not searched");
    return;
  }
  for (std::size_t axis = 0; axis < parameters.size(); ++axis) {
    const double bound = axis < 3 ? options.bound_mm : options.bound_rad * kLeverMm;
    if (std::abs(parameters[axis]) >= kAtBoundShare * bound)
      review(result, fmt::format("the {} ended at its bound", kAxes[axis]));
  }
  if (result.stages.empty() || result.stages.back().reached_limit)
    review(result, "the last stage of the search did not converge");
  // Of the whole, if bodies answered: they went on from one of its poses.
  for (const StageReport& stage : result.stages)
    if (result.bodies.empty() && stage.spread_mm &&
        (*stage.spread_mm > kMaxSpreadMm || *stage.spread_rad > kMaxSpreadRad))
      review(result, fmt::format("searches from different starts end {:.1f} mm and {:.1f} degrees apart in stage {}",
                                 *stage.spread_mm, deg_from_rad(*stage.spread_rad), stage.name));
}

void judge_views(bool is_volume_chosen, RegistrationResult& result) {
  double mean = 0.0;
  for (std::size_t n = 0; n < result.views.size(); ++n) {
    const ViewMatch& view = result.views[n];
    const std::string name = name_of_view(view.label, n);
    mean += view.similarity_final / static_cast<double>(result.views.size());
    if (!(view.similarity_final >= view.similarity_start - kSimilarityNoise))
      review(result, fmt::format("{} matches worse than at the planned pose (similarity {:.4f}, was {:.4f})", name,
                                 view.similarity_final, view.similarity_start));
    if (view.left_out && (view.left_out->distance_mm > kMaxSpreadMm || view.left_out->angle_rad > kMaxSpreadRad))
      review(result, fmt::format("without {} the pose lies {:.1f} mm and {:.1f} degrees away", name,
                                 view.left_out->distance_mm, deg_from_rad(view.left_out->angle_rad)));
    if (!view.field.is_sure())
      review(result, fmt::format("the irradiated field of {} is not sure: {}", name, view.field.doubt));
    if (!view.has_all_excluded)
      review(result,
             fmt::format("what is excluded covers nearly all that {} shows, and was compared nevertheless", name));
    if (!result.bodies.empty())
      continue;  // the parts of the whole did not agree, or bodies would not have been searched
    const int with_signal = view.consistency.with_signal(), disagreeing = view.consistency.disagreeing();
    if (disagreeing > parts_that_may_disagree(with_signal, is_volume_chosen))
      review(result, fmt::format("{} of {} parts of {} match elsewhere: anatomy may have moved against the rest",
                                 disagreeing, with_signal, name));
    if (with_signal < 2)
      review(result, fmt::format("too little of {} is compared to tell whether anatomy moved against the rest", name));
  }
  if (!(mean >= kMinSimilarity)) {
    result.demote(mean >= kRejectedSimilarity ? Verdict::kReview : Verdict::kRejected,
                  fmt::format("the final gradient correlation {:.3f} is below {:.2f}", mean, kMinSimilarity));
  } else {
    for (std::size_t n = 0; n < result.views.size(); ++n)
      if (const ViewMatch& view = result.views[n]; !(view.similarity_final >= kMinViewSimilarity))
        review(result, fmt::format("{} hardly matches (gradient correlation {:.3f})", name_of_view(view.label, n),
                                   view.similarity_final));
  }
}

void judge_contradiction(RegistrationResult& result) {
  double squares = 0.0, variances = 0.0;
  for (const ViewMatch& view : result.views) {
    const Contradiction contradiction = view.contradiction.value_or(Contradiction());
    squares += contradiction.mm * contradiction.mm / static_cast<double>(result.views.size());
    variances += contradiction.sigma_mm * contradiction.sigma_mm / static_cast<double>(result.views.size());
  }
  const double limit_mm = std::max(kMaxContradictionMm, kMaxContradictionSigmas * std::sqrt(variances));
  if (!(std::sqrt(squares) <= limit_mm))
    review(result, fmt::format("the views contradict each other: each of them alone would want the anatomy elsewhere, "
                               "{:.1f} mm in the mean. The patient or anatomy may have moved between them or against "
                               "the rest, or an angle, a distance or a position in a file may be wrong",
                               std::sqrt(squares)));
  else if (result.apart && result.apart->is_clear())
    review(
        result,
        "the views contradict each other: a patient who lies elsewhere in each of them explains as much as bones that "
        "have moved. The patient may have moved between the images, or an angle, a distance or a position in a file "
        "may be wrong");
  else if (result.turn.is_clear() && !(result.turn.share_of_bodies_gain.value_or(1.0) <= kMostByTurn))
    review(result,
           fmt::format("the views contradict each other: each of them alone would want the patient turned, by "
                       "{:.1f} degrees against the other. A gantry angle in a file, or a projection matrix of a "
                       "machine profile, may be wrong, or the patient may have turned between the images",
                       deg_from_rad(result.turn.angle_rad)));
}

// Whether vertebrae carry the target.
bool is_by_vertebrae(const RegistrationResult& result) {
  double share = 0.0;
  for (const BodyMotion& body : result.bodies)
    if (body.vertebra) share += body.carries_target;
  return share >= kLeastByVertebrae;
}

// Coarse pixels tell right from wrong where noise and coarse images count least; contrast that has changed spoils them.
// Most of the fine pixels tell in spite of that, where vertebrae carry the target.
bool does_target_match(const RegistrationResult& result) {
  const TargetMatch& match = result.target_match;
  if (!is_by_vertebrae(result))
    return match.of_parts >= kLeastOfParts || (match.of_all >= kLeastOfAll && match.of_parts >= kLeastOfPartsOfGroups);
  return match.of_all >= kLeastOfAll ||
         (match.of_parts >= kLeastOfParts && match.of_most_within_40_mm >= kLeastWithin40MmBesideParts) ||
         (match.of_most_within_40_mm >= kLeastWithin40Mm && match.of_most_within_20_mm >= kLeastWithin20Mm);
}

std::string match_in_words(const RegistrationResult& result) {
  const TargetMatch& match = result.target_match;
  if (!is_by_vertebrae(result))
    return fmt::format(
        "gradient correlation {:.3f} and of parts by themselves {:.3f}; {:.2f} and {:.3f} are expected, or "
        "{:.2f} of parts",
        match.of_all, match.of_parts, kLeastOfAll, kLeastOfPartsOfGroups, kLeastOfParts);
  return fmt::format(
      "gradient correlation {:.3f}, {:.2f} is expected; or of parts by themselves {:.3f}, {:.2f} is "
      "expected; or of most pixels within 40 mm {:.3f} and within 20 mm {:.3f}, {:.2f} and {:.2f} are "
      "expected",
      match.of_all, kLeastOfAll, match.of_parts, kLeastOfParts, match.of_most_within_40_mm, match.of_most_within_20_mm,
      kLeastWithin40Mm, kLeastWithin20Mm);
}

// The answer is that of the bodies that carry the target: they must be seen, and the target must not be bent itself.
void judge_bodies(RegistrationResult& result) {
  if (!does_target_match(result))
    review(
        result,
        fmt::format("the target's surroundings match poorly: they may have changed (metal, fluid, gas) or be another "
                    "patient's, or the target may lie elsewhere ({})",
                    match_in_words(result)));
  // What one bone alone wants, nothing confirms: one that is nearly straight fits as well where it has slid along.
  if (std::ranges::count_if(result.bodies, &BodyMotion::is_determined) < kMinDeterminedBones)
    review(result, "the images determine no bone but the one that carries the target: nothing confirms where it lies");
  if (!(result.target_image_share >= kMinImageShare))
    review(result, fmt::format("the images hardly show the bodies that carry the target: {:.0f} % of what is known of "
                               "their place comes from them, the rest from their neighbors",
                               100.0 * result.target_image_share));
  if (!(result.target_deformation_mm <= kMaxDeformationMm))
    review(result,
           fmt::format("the target itself is bent: parts of its surface lie up to {:.1f} mm off when its center "
                       "is right",
                       result.target_deformation_mm));
}

void judge_uncertainty(const Eigen::Vector3d& target_room_mm, RegistrationResult& result) {
  const double most_rad = result.bodies.empty() ? kMaxTwoSigmaRad : kMaxTwoSigmaRadOfBodies;
  if (!result.uncertainty) {
    review(result, "the images do not determine the pose");
  } else {
    const Eigen::Vector3d two_sigma_mm = 2.0 * result.uncertainty->sigma_at_mm(target_room_mm);
    const Eigen::Vector3d two_sigma_rad = 2.0 * result.uncertainty->sigma_rotation_rad();
    for (int axis = 0; axis < 3; ++axis) {
      if (!(two_sigma_mm[axis] <= kMaxTwoSigmaMm))
        review(result, fmt::format("the target is uncertain along {}: {:.1f} mm at two sigma", "xyz"[axis],
                                   two_sigma_mm[axis]));
      if (!(two_sigma_rad[axis] <= most_rad))
        review(result, fmt::format("the {} is uncertain: {:.1f} degrees at two sigma",
                                   kAxes[static_cast<std::size_t>(axis) + 3], deg_from_rad(two_sigma_rad[axis])));
    }
  }
}

void judge_alternatives(RegistrationResult& result) {
  for (const Alternative& alternative : result.alternatives) {
    if (alternative.is_ruled_out) continue;
    const double as_is = 1.0 - alternative.as_is, as_other = 1.0 - alternative.similarity;
    if (as_other * kAlternativeMargin <= as_is)
      review(result, fmt::format("with {} the images match better ({:.3f}; as they are {:.3f})",
                                 alternative.description, alternative.similarity, alternative.as_is));
    // A ball, for one, looks the same from both sides: that is harmless where it means the same pose.
    else if (!(as_other >= kAlternativeMargin * as_is) &&
             (alternative.distance_mm > kMaxSpreadMm || alternative.angle_rad > kMaxSpreadRad))
      review(result,
             fmt::format(
                 "with {} the images match as well ({:.3f}; as they are {:.3f}), {:.1f} mm and {:.1f} degrees away",
                 alternative.description, alternative.similarity, alternative.as_is, alternative.distance_mm,
                 deg_from_rad(alternative.angle_rad)));
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

void judge(std::span<const double> parameters, const RegistrationOptions& options, RegistrationResult& result) {
  result.reasons.clear();
  result.verdict = Verdict::kAccepted;
  judge_search(parameters, options, result);
  judge_views(options.region != nullptr && options.region->has_volume(), result);
  judge_contradiction(result);
  judge_uncertainty(target_found_room_mm(options, result), result);
  if (!result.bodies.empty()) judge_bodies(result);
  judge_alternatives(result);
  if (options.is_searched && !options.check_alternatives)
    review(result, "the preset leaves out the check for mirrored, turned and exchanged images");
  // On the phantom of the demo, where ray casters end 0.1 mm beside the truth, splatting ended 1.4 mm beside it: its
  // noise belongs to the voxels, moves with them, and carries its own gradients into the last stage.
  if (const auto kind = renderer_kind_from(result.renderer); kind && is_splatting(*kind))
    review(result, fmt::format("the DRRs of {} are too noisy for the last stage of the search", result.renderer));
  if (!result.unobservable_room.empty())
    review(result, "all views look along nearly the same direction, along which nothing was measured");
}

}  // namespace isoshift
