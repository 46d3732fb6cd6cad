#include "io/study/planned_pose.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/error.h"
#include "base/option_name.h"
#include "geometry/rotation.h"
#include "io/study/session.h"

namespace isoshift {
namespace {

void warn_of_planned_displacement(const std::vector<RtPlan::Beam>& beams, Notes& notes) {
  for (const RtPlan::Beam& beam : beams)
    if (beam.setup_displacement_mm.norm() > 0.0)
      notes.warnings.push_back(fmt::format(
          "beam {} of the plan moves the table by ({:.1f}) mm (vertical, longitudinal, lateral) from marks to "
          "treatment "
          "({}): find out whether the X-rays were taken before or after that move",
          beam.number, fmt::join(beam.setup_displacement_mm, ", "), described(DCM_TableTopVerticalSetupDisplacement)));
}

// How two angles are one angle on two scales, in words; empty: in no known way. An angle that another scale moves by
// less than 4 degrees, such as a mirrored 2, tells nothing: it may be a correction.
std::string scale_between(double planned_deg, double imaged_deg) {
  constexpr double kSameDeg = 0.5, kLeastMovedDeg = 4.0;
  const auto apart_deg = [](double a_deg, double b_deg) { return std::abs(std::remainder(a_deg - b_deg, 360.0)); };
  const auto is = [&](double angle_deg) {
    return apart_deg(imaged_deg, angle_deg) <= kSameDeg && apart_deg(angle_deg, planned_deg) > kLeastMovedDeg;
  };
  if (is(-planned_deg)) return "one is the mirror image of the other (another sign, or 360 - x)";
  if (is(180.0 - planned_deg)) return "one is the other on another scale (180 - x)";
  if (is(180.0 + planned_deg)) return "one is the other on another scale (180 + x)";
  return "";
}

// Which angles of the X-rays contradict those of their beams.
class AnglesOfPlan {
 public:
  explicit AnglesOfPlan(const Study& study) : study_(study) {
    for (const RtImage& image : study.rt_images) {
      const RtPlan::Beam* beam = planned_beam(*study.plan, image);
      are_named_ = are_named_ && beam != nullptr;
      if (beam != nullptr) compare_gantry(image, *beam);
    }
  }

  // A table stands at one angle, and plans without setup beams have beams at several: where X-rays name no beam, one
  // that fits is enough.
  void compare_table(const std::vector<RtPlan::Beam>& beams, Notes& notes) {
    compare_table(
        "angle", study_.table.yaw_rad(), beams,
        [](const RtPlan::Beam& beam) {
          std::optional<double> yaw_deg = beam.support_angle_deg;
          if (yaw_deg) *yaw_deg += beam.eccentric_angle_deg.value_or(0.0);
          return yaw_deg;
        },
        notes);
    compare_table(
        "pitch", study_.table.pitch_rad, beams, [](const RtPlan::Beam& beam) { return beam.pitch_deg; }, notes);
    compare_table("roll", study_.table.roll_rad, beams, [](const RtPlan::Beam& beam) { return beam.roll_deg; }, notes);
  }

  std::vector<FailedCheck> doubts() && { return std::move(doubts_); }

 private:
  void doubt(std::string message) { doubts_.push_back({"plan-mismatch", std::move(message)}); }

  void compare_gantry(const RtImage& image, const RtPlan::Beam& beam) {
    constexpr double kMostDeg = 1.0, kArmDeg = 90.0;
    if (image.pixel_from_room || !image.gantry_angle_deg || !beam.gantry_deg) return;
    const double apart_deg = std::remainder(*image.gantry_angle_deg - *beam.gantry_deg, 360.0);
    const bool is_by_arm = std::abs(std::abs(apart_deg) - kArmDeg) <= kMostDeg;
    // A machine profile says where the source stands; the plan may mean the gantry, as the file did, or as such an arm
    // has it.
    const double as_written_deg = std::remainder(apart_deg - image.gantry_offset_deg.value_or(0.0), 360.0);
    if (std::abs(apart_deg) <= kMostDeg || std::abs(as_written_deg) <= kMostDeg) return;
    if (is_by_arm && image.gantry_offset_deg == 0.0) return;
    const std::string scale = scale_between(*beam.gantry_deg, *image.gantry_angle_deg);
    doubt(fmt::format(
        "{}: {} is {:.1f} degrees{}, that of its beam {} in the plan {:.1f} degrees: {}", image.label,
        described(DCM_GantryAngle), *image.gantry_angle_deg,
        image.gantry_offset_deg ? " with the offset of the machine profile" : "", beam.number, *beam.gantry_deg,
        is_by_arm
            ? "exactly 90 degrees apart, as the source of a kV arm is from the gantry head. A machine profile says "
              "where the source stands (gantry_angle_offset_deg, " +
                  option("machine", "FILE") + ")"
        : scale.empty() ? "the X-ray may be another beam's, or one of the angles may be wrong"
                        : scale + ": find out which is right"));
  }

  template <class Planned>
  void compare_table(const char* angle, double imaged_rad, const std::vector<RtPlan::Beam>& beams, Planned planned,
                     Notes& notes) {
    constexpr double kMostDeg = 5.0, kRoundingDeg = 1e-6;  // a couch angle may hold a correction of up to 3 degrees
    const double imaged_deg = deg_from_rad(imaged_rad);
    std::vector<std::string> contradictions, others;
    bool fits_one = false;
    for (const RtPlan::Beam& beam : beams) {
      const std::optional<double> planned_deg = planned(beam);
      if (!planned_deg) continue;
      const double apart_deg = std::abs(std::remainder(imaged_deg - *planned_deg, 360.0));
      const std::string scale = scale_between(*planned_deg, imaged_deg);
      const bool contradicts = apart_deg > kMostDeg + kRoundingDeg || !scale.empty();
      fits_one = fits_one || !contradicts;
      if (apart_deg <= kMaxTableTurnDeg + kRoundingDeg) continue;
      (contradicts ? contradictions : others)
          .push_back(fmt::format("beam {} of the plan has couch {} {:.1f} degrees, the images {:.1f} degrees; the "
                                 "images' counts{}",
                                 beam.number, angle, *planned_deg, imaged_deg, scale.empty() ? "" : ": " + scale));
    }
    if (fits_one && !are_named_) std::ranges::move(contradictions, std::back_inserter(others));
    if (!fits_one || are_named_)
      for (std::string& contradiction : contradictions) doubt(std::move(contradiction));
    std::ranges::move(others, std::back_inserter(notes.warnings));
  }

  const Study& study_;
  bool are_named_ = true;  // every X-ray names its beam
  std::vector<FailedCheck> doubts_;
};

// An X-ray in the CT's frame of reference says where the machine's isocenter lay in it (docs/dicom.md, D2).
void check_isocenter_of_images(const Study& study, const Allowances& allowed, Notes& notes) {
  std::vector<FailedCheck> findings;
  for (const RtImage& image : study.rt_images)
    if (image.isocenter_mm && image.frame_of_reference_uid == study.ct->frame_of_reference_uid &&
        (*image.isocenter_mm - study.isocenter_patient_mm).norm() > kSameIsocenterMm)
      findings.push_back(
          {"plan-mismatch",
           fmt::format("{}: {} is ({}) mm, the planned one is ({}) mm in the same {}", image.path.string(),
                       described(DCM_IsocenterPosition), fmt::join(*image.isocenter_mm, ", "),
                       fmt::join(study.isocenter_patient_mm, ", "), described(DCM_FrameOfReferenceUID))});
  settle(findings, allowed, notes);
}

// An isocenter that a person supplies against the plan: with beams of several isocenters it is one of these.
std::vector<FailedCheck> isocenter_doubts(const Study& study, const std::vector<RtPlan::Beam>& beams) {
  const RtPlan::Beam* other = nullptr;
  for (const RtPlan::Beam& beam : beams) {
    if (!beam.isocenter_patient_mm) continue;
    if ((*beam.isocenter_patient_mm - study.isocenter_patient_mm).norm() <= kSameIsocenterMm) return {};
    other = &beam;
  }
  if (other == nullptr) return {};
  return {
      {"plan-mismatch",
       fmt::format("{} contradicts the plan: {} of beam {} is ({}) mm",
                   option("isocenter", fmt::format("{}", fmt::join(study.isocenter_patient_mm, ","))),
                   described(DCM_IsocenterPosition), other->number, fmt::join(*other->isocenter_patient_mm, ", "))}};
}

bool treats(const RtPlan::Beam& beam) { return beam.delivery_type != "SETUP"; }

// What is treated against what was imaged: X-rays refer to setup beams.
std::vector<FailedCheck> treated_position_doubts(const Study& study) {
  std::vector<FailedCheck> doubts;
  for (const RtPlan::Beam& beam : study.plan->beams)
    if (treats(beam) && beam.patient_position && *beam.patient_position != to_string(study.patient_position))
      doubts.push_back(
          {"plan-mismatch", fmt::format("the patient lies in {}, and beam {} of the plan treats in {} ({})",
                                        to_string(study.patient_position), beam.number, *beam.patient_position,
                                        described(DCM_PatientPosition))});
  return doubts;
}

std::vector<FailedCheck> treated_isocenter_doubts(const Study& study) {
  const RtPlan::Beam* elsewhere = nullptr;
  for (const RtPlan::Beam& beam : study.plan->beams) {
    if (!treats(beam) || !beam.isocenter_patient_mm) continue;
    if ((*beam.isocenter_patient_mm - study.isocenter_patient_mm).norm() <= kSameIsocenterMm) return {};
    elsewhere = &beam;
  }
  if (elsewhere == nullptr) return {};
  return {{"plan-mismatch",
           fmt::format("the X-rays' beams have their isocenter at ({}) mm, and no beam that treats has it: that of "
                       "beam {} is ({}) mm ({})",
                       fmt::join(study.isocenter_patient_mm, ", "), elsewhere->number,
                       fmt::join(*elsewhere->isocenter_patient_mm, ", "), described(DCM_IsocenterPosition))}};
}

// What of the plan contradicts where the patient lies. An isocenter typed in that is no beam's is said once.
std::vector<FailedCheck> plan_doubts(const StudyRequest& request, const Study& study,
                                     const std::vector<RtPlan::Beam>& beams) {
  std::vector<FailedCheck> doubts = treated_position_doubts(study);
  std::vector<FailedCheck> of_isocenter;
  if (request.isocenter_patient_mm) of_isocenter = isocenter_doubts(study, beams);
  if (of_isocenter.empty()) of_isocenter = treated_isocenter_doubts(study);
  std::ranges::move(of_isocenter, std::back_inserter(doubts));
  return doubts;
}

}  // namespace

const RtPlan::Beam* planned_beam(const RtPlan& plan, const RtImage& image) {
  if (!image.beam_number || image.plan_sop_instance_uid != plan.sop_instance_uid) return nullptr;
  return &beam_numbered(plan, *image.beam_number);
}

void place_patient(const StudyRequest& request, const std::vector<RtPlan::Beam>& beams, Study& study, Notes& notes) {
  study.patient_position = patient_position_from(study.rt_images.front().patient_position.value()).value();
  study.table = table_angles(study.rt_images, notes);
  if (request.isocenter_patient_mm) {
    study.isocenter_patient_mm = *request.isocenter_patient_mm;
    notes.overrides.push_back(fmt::format("{}: ({}) mm by {}", described(DCM_IsocenterPosition),
                                          fmt::join(study.isocenter_patient_mm, ", "), option("isocenter")));
    check_isocenter_of_images(study, request.allowed, notes);
  } else if (study.plan) {
    study.isocenter_patient_mm = common_isocenter(*study.plan, beams);
    check_isocenter_of_images(study, request.allowed, notes);
  } else {
    throw Error(fmt::format(
        "no RT Plan found ({}), so the planned isocenter is unknown.\n"
        "       Name the plan ({}) or supply the isocenter: {}",
        request.parts.study.empty() ? "no study folder was given" : "searched " + request.parts.study.string(),
        option("plan", "FILE"), option("isocenter", "X,Y,Z")));
  }
  if (const auto planned = study.plan ? common_patient_position(*study.plan, beams) : std::nullopt;
      planned && *planned != to_string(study.patient_position))
    throw Error(fmt::format(
        "{}: {} is {}, that of {} is {}",
        request.switches.patient_position ? option("patient-position") : study.rt_images.front().path.string(),
        described(DCM_PatientPosition), to_string(study.patient_position), study.plan->path.string(), *planned));
  if (!study.ct->patient_position.empty() && study.ct->patient_position != to_string(study.patient_position))
    notes.warnings.push_back(fmt::format("the CT was scanned in {}, the patient is treated in {} ({})",
                                         study.ct->patient_position, to_string(study.patient_position),
                                         described(DCM_PatientPosition)));
  if (study.plan) {
    std::vector<FailedCheck> doubts = plan_doubts(request, study, beams);
    AnglesOfPlan angles(study);
    angles.compare_table(beams, notes);
    std::ranges::move(std::move(angles).doubts(), std::back_inserter(doubts));
    std::ranges::move(unsettled(doubts, request.allowed, notes), std::back_inserter(study.doubts));
  }
  warn_of_planned_displacement(beams, notes);
  study.planned_room_from_patient =
      planned_room_from_patient(study.patient_position, study.table, study.isocenter_patient_mm);
}

}  // namespace isoshift
