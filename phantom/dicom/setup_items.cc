#include "phantom/dicom/setup_items.h"

#include <cmath>
#include <numbers>
#include <vector>

namespace isoshift {

void put_common(DicomItem dataset, const Identity& identity, const SopInstance& instance, const char* manufacturer) {
  put_identity(dataset, identity);
  dataset.put(DCM_SOPClassUID, instance.class_uid);
  dataset.put(DCM_SOPInstanceUID, instance.uid);
  dataset.put(DCM_Modality, instance.modality);
  dataset.put(DCM_SeriesInstanceUID, instance.series_uid);
  dataset.put(DCM_SeriesNumber, "1");
  dataset.put(DCM_FrameOfReferenceUID, instance.frame_of_reference_uid);
  dataset.put(DCM_PositionReferenceIndicator, "");
  dataset.put(DCM_Manufacturer, manufacturer);
  dataset.put(DCM_OperatorsName, "");
}

void put_setup_beam(DicomItem beam, const SetupBeam& setup) {
  beam.put(DCM_TreatmentMachineName, setup.machine);
  beam.put(DCM_PrimaryDosimeterUnit, "MU");
  beam.put(DCM_SourceAxisDistance, setup.sad_mm);
  beam.put_empty_sequence(DCM_BeamLimitingDeviceSequence);
  beam.put(DCM_BeamNumber, setup.number);
  beam.put(DCM_BeamName, setup.name);
  beam.put(DCM_BeamType, "STATIC");
  beam.put(DCM_RadiationType, "PHOTON");
  beam.put(DCM_TreatmentDeliveryType, "SETUP");
  for (const DcmTagKey& count : {DCM_NumberOfWedges, DCM_NumberOfCompensators, DCM_NumberOfBoli, DCM_NumberOfBlocks})
    beam.put(count, 0);
  beam.put(DCM_FinalCumulativeMetersetWeight, 0.0);
  beam.put(DCM_NumberOfControlPoints, 1);
  DicomItem point = beam.append_item(DCM_ControlPointSequence);
  point.put(DCM_ControlPointIndex, 0);
  point.put(DCM_CumulativeMetersetWeight, 0.0);
  point.put(DCM_GantryAngle, setup.gantry_deg);
  point.put(DCM_GantryRotationDirection, "NONE");
  point.put(DCM_BeamLimitingDeviceAngle, 0.0);
  point.put(DCM_BeamLimitingDeviceRotationDirection, "NONE");
  point.put(DCM_PatientSupportAngle, setup.couch_deg);
  point.put(DCM_PatientSupportRotationDirection, "NONE");
  point.put(DCM_TableTopEccentricAngle, 0.0);
  point.put(DCM_TableTopEccentricRotationDirection, "NONE");
  point.put(DCM_IsocenterPosition, std::span(setup.isocenter_patient_mm.data(), 3));
  beam.put(DCM_ReferencedPatientSetupNumber, 1);
}

void put_target_reference(DicomItem plan) {
  DicomItem reference = plan.append_item(DCM_DoseReferenceSequence);
  reference.put(DCM_DoseReferenceNumber, 1);
  reference.put(DCM_DoseReferenceStructureType, "VOLUME");
  reference.put(DCM_DoseReferenceType, "TARGET");
  reference.put(DCM_ReferencedROINumber, 1);
}

void put_ball_target(DicomItem structures, const BallTarget& target, const std::string& frame_of_reference_uid,
                     std::span<const double> slices_mm, double most_mm) {
  DicomItem roi = structures.append_item(DCM_StructureSetROISequence);
  roi.put(DCM_ROINumber, 1);
  roi.put(DCM_ReferencedFrameOfReferenceUID, frame_of_reference_uid);
  roi.put(DCM_ROIName, target.name);
  roi.put(DCM_ROIGenerationAlgorithm, "AUTOMATIC");
  DicomItem drawn = structures.append_item(DCM_ROIContourSequence);
  drawn.put(DCM_ReferencedROINumber, 1);
  const Eigen::Vector3d along_rows = Eigen::Vector3d::UnitX(), along_columns = target.slice_normal.cross(along_rows);
  for (const double slice_mm : slices_mm) {
    const double height_mm = slice_mm - target.slice_normal.dot(target.center_patient_mm);
    if (std::abs(height_mm) >= most_mm) continue;
    const double radius_mm = std::sqrt(target.radius_mm * target.radius_mm - height_mm * height_mm);
    std::vector<double> points;
    for (int n = 0; n < target.contour_points; ++n) {
      const double angle = 2.0 * std::numbers::pi * n / target.contour_points;
      const Eigen::Vector3d point = target.center_patient_mm + height_mm * target.slice_normal +
                                    radius_mm * (std::cos(angle) * along_rows + std::sin(angle) * along_columns);
      points.insert(points.end(), {point.x(), point.y(), point.z()});
    }
    DicomItem contour = drawn.append_item(DCM_ContourSequence);
    contour.put(DCM_ContourGeometricType, "CLOSED_PLANAR");
    contour.put(DCM_NumberOfContourPoints, target.contour_points);
    contour.put(DCM_ContourData, points);
  }
  DicomItem observation = structures.append_item(DCM_RTROIObservationsSequence);
  observation.put(DCM_ObservationNumber, 1);
  observation.put(DCM_ReferencedROINumber, 1);
  observation.put(DCM_RTROIInterpretedType, target.interpreted_type);
  observation.put(DCM_ROIInterpreter, "");
}

}  // namespace isoshift
