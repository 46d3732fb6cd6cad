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

void warn_of_planned_table(const Study& study, const std::vector<RtPlan::Beam>& beams, Notes& notes) {
  for (const RtPlan::Beam& beam : beams) {
    const auto compare = [&](const char* angle, const std::optional<double>& planned_deg, double imaged_rad) {
      const double change_rad = wrapped_rad(rad_from_deg(planned_deg.value_or(0.0)) - imaged_rad);
      if (!planned_deg || std::abs(change_rad) <= rad_from_deg(kMaxTableTurnDeg)) return;
      notes.warnings.push_back(
          fmt::format("beam {} of the plan has couch {} {:.1f} degrees, the images {:.1f} degrees; the images' counts",
                      beam.number, angle, *planned_deg, deg_from_rad(imaged_rad)));
    };
    std::optional<double> yaw_deg = beam.support_angle_deg;
    if (yaw_deg) *yaw_deg += beam.eccentric_angle_deg.value_or(0.0);
    compare("angle", yaw_deg, study.table.yaw_rad());
    compare("pitch", beam.pitch_deg, study.table.pitch_rad);
    compare("roll", beam.roll_deg, study.table.roll_rad);
  }
}

// An X-ray in the CT's frame of reference says where the machine's isocenter lay in it (docs/dicom.md, D2).
void check_isocenter_of_images(const Study& study, const Allowances& allowed, Notes& notes) {
  std::vector<Finding> findings;
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
std::vector<Finding> isocenter_doubts(const Study& study, const std::vector<RtPlan::Beam>& beams) {
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
std::vector<Finding> treated_position_doubts(const Study& study) {
  std::vector<Finding> doubts;
  for (const RtPlan::Beam& beam : study.plan->beams)
    if (treats(beam) && beam.patient_position && *beam.patient_position != to_string(study.patient_position))
      doubts.push_back(
          {"plan-mismatch", fmt::format("the patient lies in {}, and beam {} of the plan treats in {} ({})",
                                        to_string(study.patient_position), beam.number, *beam.patient_position,
                                        described(DCM_PatientPosition))});
  return doubts;
}

std::vector<Finding> treated_isocenter_doubts(const Study& study) {
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
std::vector<Finding> plan_doubts(const StudyRequest& request, const Study& study,
                                 const std::vector<RtPlan::Beam>& beams) {
  std::vector<Finding> doubts = treated_position_doubts(study);
  std::vector<Finding> of_isocenter;
  if (request.isocenter_patient_mm) of_isocenter = isocenter_doubts(study, beams);
  if (of_isocenter.empty()) of_isocenter = treated_isocenter_doubts(study);
  std::ranges::move(of_isocenter, std::back_inserter(doubts));
  return doubts;
}

}  // namespace

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
  if (study.plan)
    std::ranges::move(unsettled(plan_doubts(request, study, beams), request.allowed, notes),
                      std::back_inserter(study.doubts));
  warn_of_planned_table(study, beams, notes);
  warn_of_planned_displacement(beams, notes);
  study.planned_room_from_patient =
      planned_room_from_patient(study.patient_position, study.table, study.isocenter_patient_mm);
}

}  // namespace isoshift
