#pragma once
// How a patient lies on the table, and the planned pose that follows from it.

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string_view>

#include "geometry/rotation.h"

namespace isoshift {

// PatientPosition (0018,5100), DICOM PS3.3 C.7.3.1.1.2. DR and DL: lying on the right or left side.
enum class PatientPosition { kHfs, kHfp, kFfs, kFfp, kHfdr, kHfdl, kFfdr, kFfdl };

inline constexpr std::array kPatientPositions = {PatientPosition::kHfs,  PatientPosition::kHfp,  PatientPosition::kFfs,
                                                 PatientPosition::kFfp,  PatientPosition::kHfdr, PatientPosition::kHfdl,
                                                 PatientPosition::kFfdr, PatientPosition::kFfdl};

std::string_view to_string(PatientPosition position);
std::optional<PatientPosition> patient_position_from(std::string_view defined_term);

// Rows are the IEC 61217 table-top axes (x, y, z) in DICOM patient axes (LPS), at table pitch and roll 0.
Eigen::Matrix3d table_from_patient_axes(PatientPosition position);

// Table read-outs at imaging, IEC 61217 (PS3.3 C.8.8.25.6): fixed <- support <- eccentric <- pitched, rolled table top.
struct TableAngles {
  double support_rad = 0.0;  // Patient Support Angle (300A,0122), about fixed z, positive counter-clockwise from above
  double eccentric_rad = 0.0;  // Table Top Eccentric Angle (300A,0125), about the eccentric axis, which is vertical too
  double pitch_rad = 0.0;      // Table Top Pitch Angle (300A,0140), about table x
  double roll_rad = 0.0;       // Table Top Roll Angle (300A,0144), about the pitched table y

  double yaw_rad() const { return support_rad + eccentric_rad; }
  ZxyAngles zxy() const { return {.z_rad = yaw_rad(), .x_rad = pitch_rad, .y_rad = roll_rad}; }
};

// The pose of a patient lying exactly as planned: the isocenter (DICOM patient coordinates, mm) at the origin of the
// room, which is IEC 61217 fixed. Table translations and the eccentric distance cancel, since the machine's isocenter
// is known in patient coordinates.
Eigen::Isometry3d planned_room_from_patient(PatientPosition position, const TableAngles& table,
                                            const Eigen::Vector3d& isocenter_patient_mm);

}  // namespace isoshift
