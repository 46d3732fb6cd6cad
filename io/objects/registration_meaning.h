#pragma once
// What a Spatial Registration object of any program means for the couch, and how far two such objects lie apart. Both
// need the position of the machine's isocenter in the source frame of the object. If this position is not known, no
// number is given (docs/commands/check.md).

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>

#include "base/option_name.h"
#include "geometry/patient_setup.h"
#include "io/dicom/rt_plan.h"
#include "io/objects/registration_check.h"
#include "setup/couch_shift.h"

namespace isoshift {

// How the patient was planned to lie, and how the couch stood at imaging.
struct PlannedSetup {
  std::optional<RtPlan> plan;  // must be of the registration's patient and in its registered frame
  PatientPosition patient_position = PatientPosition::kHfs;
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  std::optional<double> couch_angle_deg, couch_pitch_deg, couch_roll_deg;  // IEC 61217; without value not known

  TableAngles table() const;  // angles that are not known are 0
  Eigen::Isometry3d room_from_patient() const;
};

// The matrix of an object as a rigid motion; nothing where the object holds none.
std::optional<Eigen::Isometry3d> rigid_of(const CheckedRegistration& checked);

// Throws UsageError if the source frame of every object is known to have its origin at the machine's isocenter, but
// `source_isocenter_mm` names another point.
void refuse_contradicting_isocenter(std::span<const CheckedRegistration> all,
                                    const Eigen::Vector3d& source_isocenter_mm);

struct RegistrationMeaning {
  std::optional<Eigen::Vector3d> source_isocenter_mm;  // the machine's isocenter in the source frame, where known
  // From a frame that begins at the machine's isocenter to the registered frame: its translation is the point of the CT
  // that lies at the machine's isocenter. Nothing where that is not known.
  std::optional<Eigen::Isometry3d> registered_from_isocenter;
  // The same if the matrix had been written the wrong way around.
  std::optional<Eigen::Isometry3d> inverse_from_isocenter;
  bool in_room_axes = false;  // that frame has the axes of the room, else those of the patient as set up on the couch
  // Where `setup` was given and nothing stands in the way.
  std::optional<Eigen::Isometry3d> setup_error;
  std::optional<CouchShift> couch_shift;
};

// Adds findings: notes on what was assumed and on what prevents a number. If `setup` asks for the couch shift, what
// prevents it is an error. `says_where`: who says where the machine's isocenter lies in the source frame.
RegistrationMeaning meaning_of(CheckedRegistration& checked, const std::optional<PlannedSetup>& setup,
                               const std::optional<Eigen::Vector3d>& source_isocenter_mm,
                               const std::string& says_where = option("source-isocenter"));

struct RegistrationDifference {
  double translation_mm = 0.0;  // between the points of the CT that the two have at the machine's isocenter
  double angle_rad = 0.0;
  bool other_is_inverted = false;  // the other one, written the wrong way around, would lie much nearer
};
RegistrationDifference difference_between(const Eigen::Isometry3d& registered_from_isocenter,
                                          const Eigen::Isometry3d& other, const Eigen::Isometry3d& other_inverse);

struct RegistrationComparison {
  std::optional<RegistrationDifference> difference;
  std::string why_not;          // where there is no difference: what stands in the way, and what to do
  bool has_patient_ids = true;  // false: a PatientID is empty, and only the frame says that both are of one patient
};
RegistrationComparison compare(const CheckedRegistration& first, const RegistrationMeaning& first_meaning,
                               const CheckedRegistration& second, const RegistrationMeaning& second_meaning);

}  // namespace isoshift
