#include "io/objects/registration_meaning.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "base/error.h"
#include "base/option_name.h"
#include "geometry/rotation.h"
#include "io/objects/spatial_registration.h"
#include "io/study/session.h"

namespace isoshift {
namespace {

// Beyond these a matrix is of another frame or another isocenter, not of a patient's setup.
constexpr double kMaxSetupErrorMm = 100.0, kMaxSetupErrorRad = rad_from_deg(30.0);
constexpr double kLargeSetupErrorMm = 10.0;  // beyond it a person should look at the isocenter

bool is_from_room(const CheckedRegistration& checked) { return checked.source_frame_uid == kIecFixedFrameUid; }

// Why the source frame is known to begin at the machine's isocenter; nothing where it may begin anywhere.
std::optional<std::string> why_it_begins_at_isocenter(const CheckedRegistration& checked) {
  if (is_from_room(checked))
    return "its source frame is IEC 61217 Fixed, which begins at the machine's isocenter by definition";
  if (checked.is_by_isoshift && !checked.source_is_that_of_images && !checked.source_frame_uid.empty())
    return "isoshift wrote it, and its treatment frame begins at the machine's isocenter";
  return std::nullopt;
}

std::string why_origin_is_unknown(const CheckedRegistration& checked) {
  if (checked.source_frame_uid.empty())
    return fmt::format(
        "the item with the matrix names no {}, so the machine's isocenter has no place in its source frame",
        described(DCM_FrameOfReferenceUID));
  return fmt::format(
      "its source frame {} is {}, which may begin anywhere. Say where the machine's isocenter lies in that frame: {} "
      "(the IsocenterPosition (300A,012C) of RT Images; 0,0,0 for a cone-beam CT whose frame begins at the isocenter)",
      checked.source_frame_uid,
      checked.source_is_that_of_images ? "that of the images it lists" : "one of another program",
      option("source-isocenter", "X,Y,Z"));
}

// Where the machine's isocenter lies in the source frame. Nothing, and a finding, where nobody says.
std::optional<Eigen::Vector3d> source_isocenter(CheckedRegistration& checked, bool asks_for_shift,
                                                const std::optional<Eigen::Vector3d>& supplied_mm,
                                                const std::string& says_where) {
  if (const auto why = why_it_begins_at_isocenter(checked)) {
    if (asks_for_shift && !is_from_room(checked))
      checked.note("its source frame is taken to begin at the isocenter: " + *why);
    return Eigen::Vector3d::Zero();
  }
  if (supplied_mm && !checked.source_frame_uid.empty()) {
    checked.note(fmt::format(
        "the machine's isocenter lies at ({:.3f}) mm of its source frame {}, by {}{}", fmt::join(*supplied_mm, ", "),
        checked.source_frame_uid, says_where,
        checked.is_by_isoshift
            ? ""
            : "; the axes of that frame are taken as those of the patient as set up on the couch (HFS: x left, y "
              "posterior, z superior)"));
    return supplied_mm;
  }
  if (asks_for_shift || supplied_mm)
    checked.error("the couch shift is not known: " + why_origin_is_unknown(checked));
  else
    checked.note(why_origin_is_unknown(checked));
  return std::nullopt;
}

// Whether the plan is of the registration's patient and in its registered frame. Adds an error for each way it is not.
bool plan_fits(CheckedRegistration& checked, const RtPlan& plan) {
  const std::string next =
      "Name the plan of this registration, or, if the isocenter is known to be right: " + option("isocenter", "X,Y,Z") +
      " and " + option("patient-position", "HFS") + " instead of " + option("plan");
  bool fits = true;
  for (const FailedCheck& finding :
       patient_findings({&checked.identity, checked.path.string()}, {&plan.identity, plan.path.string()})) {
    checked.error(fmt::format("the couch shift is not known: {}. {}", finding.message, next));
    fits = false;
  }
  if (!plan.frame_of_reference_uid && plan.geometry == "TREATMENT_DEVICE") {
    checked.error(
        fmt::format("the couch shift is not known: {}: {} is TREATMENT_DEVICE and {} is missing, so nothing says where "
                    "its isocenter lies in the registered frame. {}",
                    plan.path.string(), described(DCM_RTPlanGeometry), described(DCM_FrameOfReferenceUID), next));
    fits = false;
  } else if (!plan.frame_of_reference_uid) {
    checked.note(fmt::format("{}: {} is missing; taken as that of the registered frame, {}", plan.path.string(),
                             described(DCM_FrameOfReferenceUID), checked.registered_frame_uid));
  } else if (*plan.frame_of_reference_uid == checked.source_frame_uid) {
    checked.error(
        fmt::format("the couch shift is not known: it takes the frame of {} to another one, {}: it registers the other "
                    "way around. Write it with the planning CT as the registered image",
                    plan.path.string(), checked.registered_frame_uid));
    fits = false;
  } else if (*plan.frame_of_reference_uid != checked.registered_frame_uid) {
    checked.error(fmt::format(
        "the couch shift is not known: {}: {} is {}, that of {}, the registered frame, is {}, so the plan's isocenter "
        "does not apply. {}",
        plan.path.string(), described(DCM_FrameOfReferenceUID), *plan.frame_of_reference_uid, checked.path.string(),
        checked.registered_frame_uid, next));
    fits = false;
  }
  return fits;
}

// `inverse` is what the matrix would be if it had been written the wrong way around.
bool begins_near_isocenter(CheckedRegistration& checked, const Eigen::Isometry3d& matrix,
                           const Eigen::Isometry3d& inverse, const Eigen::Vector3d& isocenter_patient_mm) {
  const auto off_mm = [&](const Eigen::Isometry3d& pose) { return (pose.translation() - isocenter_patient_mm).norm(); };
  constexpr double kFarMm = 20.0, kMuchNearer = 0.25;
  const bool looks_inverted = off_mm(matrix) > kFarMm && off_mm(inverse) < kMuchNearer * off_mm(matrix);
  if (off_mm(matrix) < kMaxSetupErrorMm && !looks_inverted) {
    if (off_mm(matrix) > kLargeSetupErrorMm)
      checked.note(
          fmt::format("its origin lies {:.0f} mm from the planned isocenter: compare that of the plan with the "
                      "isocenter that was treated",
                      off_mm(matrix)));
    if (off_mm(inverse) < kFarMm)
      checked.note(
          "its inverse begins near the planned isocenter, too: a matrix that was written the wrong way around "
          "could not be told from a right one");
    return true;
  }
  checked.error(fmt::format(
      "the couch shift is not known: its origin lies {:.0f} mm from the planned isocenter: {}", off_mm(matrix),
      off_mm(inverse) < kMaxSetupErrorMm
          ? "the matrix looks inverted, as its inverse begins near it"
          : "it is of another isocenter or another frame. Compare the isocenter of the plan with that of the object"));
  return false;
}

void note_assumed_angles(CheckedRegistration& checked, const PlannedSetup& setup) {
  std::vector<std::string> angles, flags;
  if (!setup.couch_pitch_deg) {
    angles.emplace_back("pitch");
    flags.emplace_back(option("couch-pitch", "DEG"));
  }
  if (!setup.couch_roll_deg) {
    angles.emplace_back("roll");
    flags.emplace_back(option("couch-roll", "DEG"));
  }
  if (!angles.empty())
    checked.note(fmt::format("couch {} at imaging taken as 0: {} if the couch stood otherwise",
                             fmt::join(angles, " and "), fmt::join(flags, " and ")));
}

}  // namespace

TableAngles PlannedSetup::table() const {
  return {.support_rad = rad_from_deg(couch_angle_deg.value_or(0.0)),
          .pitch_rad = rad_from_deg(couch_pitch_deg.value_or(0.0)),
          .roll_rad = rad_from_deg(couch_roll_deg.value_or(0.0))};
}

Eigen::Isometry3d PlannedSetup::room_from_patient() const {
  return planned_room_from_patient(patient_position, table(), isocenter_patient_mm);
}

std::optional<Eigen::Isometry3d> rigid_of(const CheckedRegistration& checked) {
  return checked.registered_from_source ? as_rigid(*checked.registered_from_source) : std::nullopt;
}

void refuse_contradicting_isocenter(std::span<const CheckedRegistration> all,
                                    const Eigen::Vector3d& source_isocenter_mm) {
  const CheckedRegistration* of_another = nullptr;  // object whose isocenter the switch tells
  for (const CheckedRegistration& checked : all) {
    if (why_it_begins_at_isocenter(checked)) continue;
    if (of_another != nullptr && of_another->source_frame_uid != checked.source_frame_uid)
      throw UsageError(
          fmt::format("{}: {} and {} start from different frames, in which the machine's isocenter lies at different "
                      "places. Check them one after the other",
                      option("source-isocenter", fmt::format("{}", fmt::join(source_isocenter_mm, ","))),
                      of_another->path.string(), checked.path.string()));
    of_another = &checked;
  }
  const auto is_known = [](const CheckedRegistration& checked) {
    return why_it_begins_at_isocenter(checked).has_value();
  };
  if (source_isocenter_mm.isZero(0.0) || !std::ranges::all_of(all, is_known)) return;
  throw UsageError(fmt::format("{}: {}: {}. Leave the switch out",
                               option("source-isocenter", fmt::format("{}", fmt::join(source_isocenter_mm, ","))),
                               all.front().path.string(), *why_it_begins_at_isocenter(all.front())));
}

RegistrationMeaning meaning_of(CheckedRegistration& checked, const std::optional<PlannedSetup>& setup,
                               const std::optional<Eigen::Vector3d>& source_isocenter_mm,
                               const std::string& says_where) {
  RegistrationMeaning meaning;
  const std::optional<Eigen::Isometry3d> as_written = rigid_of(checked);
  if (!as_written) {
    if (setup || source_isocenter_mm)
      checked.error("it holds no rigid matrix from one frame to another: there is no couch shift in it");
    return meaning;
  }
  const bool fits = !setup || !setup->plan || plan_fits(checked, *setup->plan);
  meaning.source_isocenter_mm = source_isocenter(checked, setup.has_value(), source_isocenter_mm, says_where);
  if (!meaning.source_isocenter_mm) return meaning;
  Eigen::Isometry3d matrix = *as_written, inverse = as_written->inverse();
  matrix.translate(*meaning.source_isocenter_mm);
  inverse.translate(*meaning.source_isocenter_mm);
  meaning.in_room_axes = is_from_room(checked);
  if (meaning.in_room_axes && setup && fits) {
    if (setup->couch_angle_deg) {
      // From the axes of the patient as set up, which the plan and the couch turn into those of the room.
      matrix.rotate(setup->room_from_patient().linear());
      inverse.rotate(setup->room_from_patient().linear());
      meaning.in_room_axes = false;
    } else {
      checked.error(
          "the couch shift is not known: its source frame has the axes of the room (IEC 61217 Fixed), and the couch "
          "angle at imaging is not known. Supply it: " +
          option("couch-angle", "DEG"));
    }
  }
  meaning.registered_from_isocenter = matrix;
  meaning.inverse_from_isocenter = inverse;
  if (!setup || !fits || meaning.in_room_axes) return meaning;
  if (!begins_near_isocenter(checked, matrix, inverse, setup->isocenter_patient_mm)) return meaning;
  note_assumed_angles(checked, *setup);
  const Eigen::Isometry3d planned = setup->room_from_patient();
  const Eigen::Isometry3d actual = actual_room_from_patient(planned, matrix);
  const Eigen::Isometry3d setup_error = setup_error_from_poses(planned, actual);
  if (const double turn_rad = Eigen::AngleAxisd(setup_error.linear()).angle(); turn_rad > kMaxSetupErrorRad) {
    checked.error(fmt::format(
        "the couch shift is not known: the patient would be turned by {:.0f} degrees. Compare the axes of the source "
        "frame, the couch angle and the patient position with those of the treatment",
        deg_from_rad(turn_rad)));
    return meaning;
  }
  meaning.setup_error = setup_error;
  meaning.couch_shift = couch_shift_for(setup_error, setup->table());
  return meaning;
}

RegistrationDifference difference_between(const Eigen::Isometry3d& registered_from_isocenter,
                                          const Eigen::Isometry3d& other, const Eigen::Isometry3d& other_inverse) {
  const auto between = [&](const Eigen::Isometry3d& pose) {
    const Eigen::Isometry3d difference = pose.inverse() * registered_from_isocenter;
    return std::pair(difference.translation().norm(), Eigen::AngleAxisd(difference.linear()).angle());
  };
  const auto [translation_mm, angle_rad] = between(other);
  constexpr double kMuchNearer = 0.1, kFarMm = 1.0;
  return {.translation_mm = translation_mm,
          .angle_rad = angle_rad,
          .other_is_inverted = translation_mm > kFarMm && between(other_inverse).first < kMuchNearer * translation_mm};
}

RegistrationComparison compare(const CheckedRegistration& first, const RegistrationMeaning& first_meaning,
                               const CheckedRegistration& second, const RegistrationMeaning& second_meaning) {
  const auto cannot = [](std::string why) { return RegistrationComparison{.why_not = std::move(why)}; };
  const std::array both = {&first, &second};
  for (const CheckedRegistration* checked : both)
    if (!rigid_of(*checked))
      return cannot(fmt::format("{}: holds no rigid matrix from one frame to another", checked->path.string()));
  if (first.registered_frame_uid != second.registered_frame_uid)
    return cannot(fmt::format(
        "they register different frames ({}): {} registers {}, {} registers {}. Compare registrations of one planning "
        "CT only",
        described(DCM_FrameOfReferenceUID), first.path.string(), first.registered_frame_uid, second.path.string(),
        second.registered_frame_uid));
  Identity patient = first.identity, other_patient = second.identity;
  const bool has_ids = !patient.patient_id.empty() && !other_patient.patient_id.empty();
  if (!has_ids) patient.patient_id = other_patient.patient_id = "not compared";
  for (const FailedCheck& finding :
       patient_findings({&patient, first.path.string()}, {&other_patient, second.path.string()}))
    return cannot(finding.message + ". Compare registrations of one patient only");
  const std::array meanings = {&first_meaning, &second_meaning};
  for (std::size_t n = 0; n < both.size(); ++n)
    if (!meanings[n]->registered_from_isocenter)
      return cannot(fmt::format("{}: {}", both[n]->path.string(), why_origin_is_unknown(*both[n])));
  if (first_meaning.in_room_axes != second_meaning.in_room_axes) {
    const bool is_first = first_meaning.in_room_axes;
    return cannot(
        fmt::format("{} starts from the axes of the room (IEC 61217 Fixed), {} from {}, with the axes of the patient "
                    "as set up. Say how the two are turned: {}, or {} and {}, and {}",
                    (is_first ? first : second).path.string(), (is_first ? second : first).path.string(),
                    (is_first ? second : first).source_frame_uid, option("plan", "FILE"), option("isocenter", "X,Y,Z"),
                    option("patient-position", "HFS"), option("couch-angle", "DEG")));
  }
  return {.difference =
              difference_between(*first_meaning.registered_from_isocenter, *second_meaning.registered_from_isocenter,
                                 *second_meaning.inverse_from_isocenter),
          .why_not = "",
          .has_patient_ids = has_ids};
}

}  // namespace isoshift
