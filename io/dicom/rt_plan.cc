#include "io/dicom/rt_plan.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "base/option_name.h"

namespace isoshift {
namespace {

// A beam whose isocenter moves while it is delivered has none to which a patient could be set up.
void check_same_isocenter(const RtPlan::Beam& beam, const Eigen::Vector3d& isocenter_mm, const DicomItem& point) {
  constexpr double kSameMm = 0.01;
  if (!beam.isocenter_patient_mm || (isocenter_mm - *beam.isocenter_patient_mm).norm() <= kSameMm) return;
  throw Error(
      fmt::format("{}: {} is ({}), that of the first control point is ({}) mm; beams with a moving isocenter are "
                  "not supported",
                  point.where(), described(DCM_IsocenterPosition), fmt::join(isocenter_mm, ", "),
                  fmt::join(*beam.isocenter_patient_mm, ", ")));
}

// GantryAngle of a beam whose gantry stands still.
std::optional<double> standing_gantry_deg(const std::vector<DicomItem>& points) {
  constexpr double kSameDeg = 0.01;
  std::optional<double> standing_deg;
  for (const DicomItem& point : points) {
    const auto here_deg = point.number(DCM_GantryAngle);
    const bool has_moved =
        here_deg && standing_deg && std::abs(std::remainder(*here_deg - *standing_deg, 360.0)) > kSameDeg;
    if (has_moved || point.text(DCM_GantryRotationDirection).value_or("NONE") != "NONE") return std::nullopt;
    if (here_deg) standing_deg = here_deg;
  }
  return standing_deg;
}

RtPlan::Beam read_beam(const DicomItem& beam_item, const DcmTagKey& control_points, const DicomItem& plan) {
  RtPlan::Beam beam;
  beam.number = beam_item.required_integer(DCM_BeamNumber);
  beam.name = beam_item.text(DCM_BeamName).value_or("");
  beam.delivery_type = beam_item.text(DCM_TreatmentDeliveryType).value_or("");
  beam.machine = beam_item.text(DCM_TreatmentMachineName).value_or("");
  if (const auto points = beam_item.items(control_points); !points.empty()) {
    if (points.front().has_value(DCM_IsocenterPosition))
      beam.isocenter_patient_mm = Eigen::Vector3d(points.front().required_numbers(DCM_IsocenterPosition, 3).data());
    const bool is_ion = control_points == DCM_IonControlPointSequence;
    beam.jaws = read_jaws(points.front().items(DCM_BeamLimitingDevicePositionSequence),
                          beam_item.items(is_ion ? DCM_IonBeamLimitingDeviceSequence : DCM_BeamLimitingDeviceSequence));
    beam.gantry_deg = standing_gantry_deg(points);
    beam.support_angle_deg = points.front().number(DCM_PatientSupportAngle);
    beam.eccentric_angle_deg = points.front().number(DCM_TableTopEccentricAngle);
    beam.pitch_deg = points.front().number(DCM_TableTopPitchAngle);
    beam.roll_deg = points.front().number(DCM_TableTopRollAngle);
    for (const DicomItem& point : points)
      if (point.has_value(DCM_IsocenterPosition))
        check_same_isocenter(beam, Eigen::Vector3d(point.required_numbers(DCM_IsocenterPosition, 3).data()), point);
  }
  const auto setup_number = beam_item.number(DCM_ReferencedPatientSetupNumber);
  std::set<std::optional<std::string>> positions;
  const std::vector<DicomItem> setups = plan.items(DCM_PatientSetupSequence);
  int found = 0;
  for (const DicomItem& setup : setups) {
    if (setup_number && setup.number(DCM_PatientSetupNumber) != setup_number) continue;
    ++found;
    positions.insert(setup.text(DCM_PatientPosition));
    const Eigen::Vector3d displacement_mm(setup.number(DCM_TableTopVerticalSetupDisplacement).value_or(0.0),
                                          setup.number(DCM_TableTopLongitudinalSetupDisplacement).value_or(0.0),
                                          setup.number(DCM_TableTopLateralSetupDisplacement).value_or(0.0));
    if (displacement_mm.norm() > beam.setup_displacement_mm.norm()) beam.setup_displacement_mm = displacement_mm;
  }
  if (setup_number && !setups.empty() && found != 1)
    throw Error(fmt::format("{}: {} is {}, a number that {} items of {} have, expected one", beam_item.where(),
                            described(DCM_ReferencedPatientSetupNumber), *setup_number, found,
                            described(DCM_PatientSetupSequence)));
  if (positions.size() == 1) beam.patient_position = *positions.begin();
  return beam;
}

}  // namespace

RtPlan read_rt_plan(const std::filesystem::path& path) {
  const DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
  const DicomItem dataset = file.dataset();
  RtPlan plan;
  plan.path = path;
  plan.sha256 = file.sha256();
  expect_modality(dataset, "RTPLAN");
  plan.identity = read_identity(dataset);
  plan.sop_class_uid = dataset.required_uid(DCM_SOPClassUID);
  plan.sop_instance_uid = dataset.required_uid(DCM_SOPInstanceUID);
  plan.series_instance_uid = dataset.uid(DCM_SeriesInstanceUID).value_or("");
  plan.label = dataset.text(DCM_RTPlanLabel).value_or("");
  plan.made_on = dataset.text(DCM_RTPlanDate).value_or("");
  plan.frame_of_reference_uid = dataset.uid(DCM_FrameOfReferenceUID);
  for (const DicomItem& structures : dataset.items(DCM_ReferencedStructureSetSequence))
    if (plan.structure_set_uid.empty())
      plan.structure_set_uid = structures.uid(DCM_ReferencedSOPInstanceUID).value_or("");
  plan.approval_status = dataset.text(DCM_ApprovalStatus).value_or("");
  plan.geometry = dataset.text(DCM_RTPlanGeometry).value_or("");
  const bool is_ion = plan.sop_class_uid == UID_RTIonPlanStorage;
  for (const DicomItem& beam : dataset.items(is_ion ? DCM_IonBeamSequence : DCM_BeamSequence)) {
    if (is_ion && beam.text(DCM_PatientSupportType) == "CHAIR")
      throw Error(fmt::format("{}: {} is CHAIR, expected TABLE", beam.where(), described(DCM_PatientSupportType)));
    plan.beams.push_back(read_beam(beam, is_ion ? DCM_IonControlPointSequence : DCM_ControlPointSequence, dataset));
    if (std::ranges::count(plan.beams, plan.beams.back().number, &RtPlan::Beam::number) > 1)
      throw Error(
          fmt::format("{}: {} {} occurs twice", beam.where(), described(DCM_BeamNumber), plan.beams.back().number));
  }
  for (const DicomItem& reference : dataset.items(DCM_DoseReferenceSequence)) {
    plan.dose_references.push_back({.number = reference.integer(DCM_DoseReferenceNumber).value_or(0),
                                    .type = reference.text(DCM_DoseReferenceType).value_or(""),
                                    .roi_number = reference.integer(DCM_ReferencedROINumber)});
  }
  if (plan.beams.empty())
    throw Error(fmt::format("{}: {} is missing or empty", path.string(),
                            described(is_ion ? DCM_IonBeamSequence : DCM_BeamSequence)));
  return plan;
}

const RtPlan::Beam& beam_numbered(const RtPlan& plan, int number) {
  const auto beam = std::ranges::find(plan.beams, number, &RtPlan::Beam::number);
  if (beam == plan.beams.end())
    throw Error(fmt::format("{}: has no beam {}, to which an image refers ({})", plan.path.string(), number,
                            described(DCM_ReferencedBeamNumber)));
  return *beam;
}

Eigen::Vector3d common_isocenter(const RtPlan& plan, std::span<const RtPlan::Beam> beams) {
  std::optional<Eigen::Vector3d> common;
  for (const RtPlan::Beam& beam : beams) {
    if (!beam.isocenter_patient_mm) continue;
    if (common && (*beam.isocenter_patient_mm - *common).norm() > 0.01)
      throw Error(
          fmt::format("{}: beams have different isocenters ({}): ({}) and ({}) mm.\n"
                      "       Say which one the patient was set up to: {}",
                      plan.path.string(), described(DCM_IsocenterPosition), fmt::join(*common, ", "),
                      fmt::join(*beam.isocenter_patient_mm, ", "), option("isocenter", "X,Y,Z")));
    common = beam.isocenter_patient_mm;
  }
  if (!common)
    throw Error(
        fmt::format("{}: {} is missing in the first control point of every beam.\n"
                    "       Supply it: {}",
                    plan.path.string(), described(DCM_IsocenterPosition), option("isocenter", "X,Y,Z")));
  return *common;
}

std::optional<std::string> common_patient_position(const RtPlan& plan, std::span<const RtPlan::Beam> beams) {
  std::optional<std::string> common;
  for (const RtPlan::Beam& beam : beams) {
    if (!beam.patient_position) continue;
    if (common && *common != *beam.patient_position)
      throw Error(fmt::format("{}: beams have different patient positions ({}): {} and {}", plan.path.string(),
                              described(DCM_PatientPosition), *common, *beam.patient_position));
    common = beam.patient_position;
  }
  return common;
}

}  // namespace isoshift
