#pragma once
// RT Plan and RT Ion Plan: the isocenter and the patient position (PS3.3 A.20, A.49, C.8.8.14).

#include <Eigen/Core>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/dicom/identity.h"
#include "io/dicom/jaws.h"

namespace isoshift {

struct RtPlan {
  struct Beam {
    int number = 0;
    std::string name;
    std::string delivery_type;                            // TreatmentDeliveryType: TREATMENT, SETUP
    std::string machine;                                  // TreatmentMachineName; may be empty
    std::optional<Eigen::Vector3d> isocenter_patient_mm;  // IsocenterPosition of the first control point
    std::optional<double> gantry_deg;  // GantryAngle, where the gantry stands still; an arc has no single angle
    // Angles of the table at the first control point: PatientSupportAngle, TableTop{Eccentric,Pitch,Roll}Angle.
    std::optional<double> support_angle_deg, eccentric_angle_deg, pitch_deg, roll_deg;
    JawOpenings jaws;  // of the first control point
    // Of the patient setup to which the beam refers. If it refers to none: the position that all setups share, and the
    // largest displacement.
    std::optional<std::string> patient_position;
    Eigen::Vector3d setup_displacement_mm = Eigen::Vector3d::Zero();  // vertical, longitudinal, lateral (300A,01D2..6)
  };

  // What the prescription speaks of (PS3.3 C.8.8.10).
  struct DoseReference {
    int number = 0;
    std::string type;               // DoseReferenceType: TARGET, ORGAN_AT_RISK
    std::optional<int> roi_number;  // ReferencedROINumber, in the plan's RT Structure Set
  };

  std::filesystem::path path;
  std::string sha256;  // of the file
  Identity identity;
  std::string sop_class_uid;
  std::string sop_instance_uid;
  std::string series_instance_uid;
  std::string label;
  std::string made_on;  // RTPlanDate; may be empty
  std::optional<std::string> frame_of_reference_uid;
  std::string structure_set_uid;  // ReferencedStructureSetSequence; empty: it refers to none
  std::string approval_status;
  std::string geometry;  // RTPlanGeometry: PATIENT, or TREATMENT_DEVICE where there is no structure set
  std::vector<Beam> beams;
  std::vector<DoseReference> dose_references;
};

RtPlan read_rt_plan(const std::filesystem::path& path);

// The beam to which an image refers by this number. Throws Error for a number that no beam has.
const RtPlan::Beam& beam_numbered(const RtPlan& plan, int number);

// The isocenter that the beams share within 0.01 mm. Throws Error where they differ or none has one.
Eigen::Vector3d common_isocenter(const RtPlan& plan, std::span<const RtPlan::Beam> beams);

// The patient position that the beams share; nothing where none says. Throws Error where they differ.
std::optional<std::string> common_patient_position(const RtPlan& plan, std::span<const RtPlan::Beam> beams);

}  // namespace isoshift
