#include "workflow/register/target_of.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "base/error.h"
#include "base/option_name.h"
#include "geometry/mask.h"
#include "io/dicom/structure_mask.h"
#include "registration/target/region_check.h"
#include "registration/target/target_volume.h"

namespace isoshift {
namespace {

constexpr const char* kIsocenter = "isocenter";

Target surroundings(std::string chosen_by) {
  Target target = isocenter_surroundings();
  target.chosen_by = std::move(chosen_by);
  return target;
}

// A structure that may be the target, and its voxels.
struct PossibleTarget {
  const Structure* structure;
  Volume<std::uint8_t> mask;
  bool holds_isocenter = false;
  bool reaches_beyond_ct = false;
  std::size_t voxels = 0;
};

// Whether contours lie more than a voxel outside of the voxels' centers.
bool reaches_beyond(const Volume<float>& ct, const Structure& structure) {
  const Eigen::Affine3d voxel_from_patient = ct.patient_from_voxel.inverse();
  const auto is_beyond = [&](const Eigen::Vector3d& point_patient_mm) {
    const Eigen::Vector3d voxel = voxel_from_patient * point_patient_mm;
    return (voxel.array() < -1.0).any() || (voxel.array() > ct.size.cast<double>().array()).any();
  };
  return std::ranges::any_of(structure.contours, [&](const Contour& contour) {
    return std::ranges::any_of(contour.points_patient_mm, is_beyond);
  });
}

PossibleTarget candidate_of(const Structure& structure, const Study& study) {
  const Volume<float>& ct = study.ct->hu;
  PossibleTarget candidate{.structure = &structure, .mask = mask_of(structure, ct.size, ct.patient_from_voxel)};
  candidate.voxels = static_cast<std::size_t>(std::ranges::count(candidate.mask.voxels, 1));
  const Eigen::Vector3d voxel = ct.patient_from_voxel.inverse() * study.isocenter_patient_mm;
  const Eigen::Vector3i at = voxel.array().round().cast<int>();
  const bool inside = (at.array() >= 0).all() && (at.array() < ct.size.array()).all();
  candidate.reaches_beyond_ct = reaches_beyond(ct, structure);
  candidate.holds_isocenter = inside && candidate.mask.at(at.x(), at.y(), at.z()) != 0;
  return candidate;
}

Target target_from(const PossibleTarget& candidate, const Study& study, std::string chosen_by) {
  Target target = target_in(candidate.mask, study.planned_room_from_patient);
  target.name = candidate.structure->name;
  target.chosen_by = std::move(chosen_by);
  return target;
}

TargetChoice choice_of(const PossibleTarget& candidate, const Study& study, const std::string& why) {
  TargetChoice choice{.target = target_from(candidate, study, why), .doubts = {}};
  if (!is_in_body(candidate.mask, study.ct->hu))
    choice.doubts.push_back(
        fmt::format("the target {} lies outside of the body for the most part: its contours may be of another CT, "
                    "flipped or turned",
                    choice.target.name));
  if (candidate.reaches_beyond_ct)
    choice.doubts.push_back(
        fmt::format("the target {} reaches beyond the CT: where its center lies, and what carries it, "
                    "is known only of the part inside",
                    choice.target.name));
  return choice;
}

TargetChoice named(const Study& study, const std::string& name, const std::string& by) {
  if (name == kIsocenter) return {.target = surroundings(by), .doubts = {}};
  if (!study.structures)
    throw Error(fmt::format("target {} ({}): {} ({} names one)", name, by, why_no_structures(study.unused_structures),
                            option("structures", "FILE")));
  return choice_of(candidate_of(structure_named(*study.structures, name), study), study, by);
}

// Of several that fit, the smallest around the isocenter, or the smallest of all.
TargetChoice chosen_among(std::vector<PossibleTarget> candidates, const Study& study, const std::string& why) {
  std::vector<std::string> names;
  names.reserve(candidates.size());
  for (const PossibleTarget& candidate : candidates) names.push_back(candidate.structure->name);
  const bool any_holds = std::ranges::any_of(candidates, &PossibleTarget::holds_isocenter);
  if (any_holds) std::erase_if(candidates, [](const PossibleTarget& candidate) { return !candidate.holds_isocenter; });
  TargetChoice choice = choice_of(*std::ranges::min_element(candidates, {}, &PossibleTarget::voxels), study, why);
  if (names.size() == 1) return choice;
  choice.doubts.push_back(fmt::format("several structures may be the target ({}); {} was taken. Name it: {}",
                                      fmt::join(names, ", "), choice.target.name, option("target", "NAME")));
  return choice;
}

// Numbers of the ROIs to which the plan's dose references of type TARGET refer.
std::vector<int> prescribed_rois(const Study& study) {
  std::vector<int> numbers;
  if (!study.plan) return numbers;
  for (const RtPlan::DoseReference& reference : study.plan->dose_references)
    if (reference.type == "TARGET" && reference.roi_number &&
        std::ranges::find(numbers, *reference.roi_number) == numbers.end())
      numbers.push_back(*reference.roi_number);
  return numbers;
}

// Numbers of ROIs count in the structure set to which the plan refers. A plan that refers to none is taken to mean the
// one there is.
bool are_rois_of_plan(const Study& study) {
  return study.structures &&
         (study.plan->structure_set_uid.empty() || study.plan->structure_set_uid == study.structures->sop_instance_uid);
}

// Of those, the ones that are drawn on this CT.
std::vector<PossibleTarget> prescribed(const Study& study) {
  std::vector<PossibleTarget> candidates;
  if (!study.plan || !are_rois_of_plan(study)) return candidates;
  for (const int number : prescribed_rois(study))
    for (const Structure& structure : study.structures->structures)
      if (structure.number == number && !structure.contours.empty())
        candidates.push_back(candidate_of(structure, study));
  return candidates;
}

// What the plan says of a target that cannot be followed.
void doubt_lost_rois(const Study& study, TargetChoice& choice) {
  if (!study.structures) return;  // whoever leaves it out knows; the report says so
  for (const int number : prescribed_rois(study)) {
    const std::string plans_target =
        fmt::format("the plan's target is ROI number {} (ReferencedROINumber (3006,0084))", number);
    const std::string instead = fmt::format("Name the target: {} or isocenter", option("target", "NAME"));
    const auto found = std::ranges::find(study.structures->structures, number, &Structure::number);
    const std::string file = study.structures->path.filename().string();
    if (!are_rois_of_plan(study))
      choice.doubts.push_back(fmt::format("{}, of another RT Structure Set than {}. {}", plans_target, file, instead));
    else if (found == study.structures->structures.end())
      choice.doubts.push_back(fmt::format("{}, which {} does not have. {}", plans_target, file, instead));
    else if (found->contours.empty())
      choice.doubts.push_back(fmt::format("{}, \"{}\", which has no closed contour on this CT in {}. {}", plans_target,
                                          found->name, file, instead));
  }
}

constexpr std::array kTargetTypes = {"PTV", "CTV", "GTV"};

bool is_target_by_type(const Structure& structure) {
  return std::ranges::find(kTargetTypes, structure.interpreted_type) != kTargetTypes.end();
}

// Where a structure set tells of no structure that it is a target volume, their names do.
bool are_targets_told_by_type(const Study& study) {
  return std::ranges::any_of(study.structures->structures, is_target_by_type);
}

std::string_view target_type(const Structure& structure, bool is_told_by_type) {
  if (!is_told_by_type) return target_type_by_name(structure);
  return is_target_by_type(structure) ? std::string_view(structure.interpreted_type) : "";
}

std::vector<PossibleTarget> around_isocenter(const Study& study, std::string_view type, bool is_told_by_type) {
  std::vector<PossibleTarget> candidates;
  for (const Structure& structure : study.structures->structures) {
    if (target_type(structure, is_told_by_type) != type || structure.contours.empty()) continue;
    PossibleTarget candidate = candidate_of(structure, study);
    if (candidate.holds_isocenter) candidates.push_back(std::move(candidate));
  }
  return candidates;
}

// Contours that are drawn elsewhere may be another CT's, and the target then is not where the isocenter is.
void doubt_targets_off_isocenter(const Study& study, bool is_told_by_type, TargetChoice& choice) {
  const Structure* nearest = nullptr;
  double nearest_mm = INFINITY;
  for (const Structure& structure : study.structures->structures) {
    if (target_type(structure, is_told_by_type).empty() || structure.contours.empty()) continue;
    const Volume<float>& ct = study.ct->hu;
    const double away_mm = distance_mm(mask_of(structure, ct.size, ct.patient_from_voxel), study.isocenter_patient_mm);
    if (away_mm < nearest_mm) nearest = &structure, nearest_mm = away_mm;
  }
  if (nearest != nullptr)
    choice.doubts.push_back(fmt::format(
        "no target volume holds the isocenter: {}, the nearest one, begins {:.0f} mm from it, and the setup was judged "
        "at the isocenter. Name the target: {}, or {}",
        nearest->name, nearest_mm, option("target", "NAME"), option("target", "isocenter")));
}

// A target volume whose contours enclose nothing may be the target all the same. One that was never drawn is none.
void doubt_open_targets(const Study& study, bool is_told_by_type, TargetChoice& choice) {
  for (const Structure& structure : study.structures->structures)
    if (!target_type(structure, is_told_by_type).empty() && structure.contours.empty() &&
        structure.ignored_contours > 0)
      choice.doubts.push_back(fmt::format(
          "the target volume {} is drawn, but none of its contours is closed ({} CLOSED_PLANAR): it may be the target. "
          "Export it as closed contours, or name the target: {} or isocenter",
          structure.name, described(DCM_ContourGeometricType), option("target", "NAME")));
}

TargetChoice chosen_by_plan(const Study& study) {
  if (std::vector<PossibleTarget> candidates = prescribed(study); !candidates.empty())
    return chosen_among(std::move(candidates), study, "dose reference of the plan");
  if (!study.structures) return {.target = surroundings(why_no_structures(study.unused_structures)), .doubts = {}};
  const bool is_told_by_type = are_targets_told_by_type(study);
  for (const char* type : kTargetTypes)
    if (std::vector<PossibleTarget> candidates = around_isocenter(study, type, is_told_by_type); !candidates.empty())
      return chosen_among(std::move(candidates), study,
                          fmt::format("the {} that holds the isocenter{}", type,
                                      is_told_by_type ? "" : ", by its name: its type is not told"));
  TargetChoice choice{.target = surroundings("no target volume holds the isocenter"), .doubts = {}};
  doubt_targets_off_isocenter(study, is_told_by_type, choice);
  doubt_open_targets(study, is_told_by_type, choice);
  return choice;
}

void doubt_near_end_of_ct(const Study& study, TargetChoice& choice) {
  const Eigen::Vector3d center = study.planned_room_from_patient.inverse() * choice.target.center_room_mm;
  if (const auto away_mm = end_of_ct_near_mm(study.ct->hu, center))
    choice.doubts.push_back(
        fmt::format("the CT ends {:.0f} mm from the target's center although the body goes on: X-rays show "
                    "there what the CT does not",
                    *away_mm));
}

TargetChoice chosen(const Study& study, const TargetWish& wish) {
  if (!wish.by_person.empty()) return named(study, wish.by_person, option("target"));
  if (!wish.by_site.empty()) return named(study, wish.by_site, "the site file");
  TargetChoice choice = chosen_by_plan(study);
  doubt_lost_rois(study, choice);
  if (!study.unused_structures.rivals.empty())
    choice.doubts.push_back(fmt::format("{}: the target may be drawn in {}. Name it: {}, or {}",
                                        why_no_structures(study.unused_structures),
                                        study.unused_structures.rivals.size() == 1 ? "it" : "one of them",
                                        option("structures", "FILE"), option("target", "isocenter")));
  return choice;
}

constexpr std::array kToldOf = {"PTV", "CTV", "GTV", "ORGAN", "AVOIDANCE", "CAVITY"};  // RT ROI Interpreted Types

}  // namespace

std::vector<Target> structures_beside(const std::string& target, const Study& study) {
  std::vector<Target> beside;
  if (!study.structures) return beside;
  for (const Structure& structure : study.structures->structures) {
    if (structure.name == target || structure.contours.empty() ||
        std::ranges::find(kToldOf, structure.interpreted_type) == kToldOf.end())
      continue;
    try {
      beside.push_back(target_from(candidate_of(structure, study), study, ""));
    } catch (const Error&) {
      continue;  // drawn across the slices, say: a registration must not fail for what it only tells of
    }
  }
  return beside;
}

TargetChoice target_of(const Study& study, const TargetWish& wish) {
  TargetChoice choice = chosen(study, wish);
  doubt_near_end_of_ct(study, choice);
  return choice;
}

PlannedPatient planned_patient(const Study& study) {
  return {.ct_hu = {study.ct, &study.ct->hu}, .room_from_patient = study.planned_room_from_patient};
}

Surrogate surrogate_of(const Study& study, const Target& target, const std::string& by_site, BodyStore& bodies) {
  if (by_site.empty()) return surrogate_near(planned_patient(study), target, bodies);
  if (!study.structures)
    throw Error(fmt::format("surrogate {} (the site file): {} ({} names one)", by_site,
                            why_no_structures(study.unused_structures), option("structures", "FILE")));
  const Volume<float>& ct = study.ct->hu;
  return surrogate_in(planned_patient(study), target,
                      {.words = fmt::format("{} (the site file)", by_site),
                       .mask = mask_of(structure_named(*study.structures, by_site), ct.size, ct.patient_from_voxel)});
}

}  // namespace isoshift
