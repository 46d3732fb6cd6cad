#pragma once
// A CT's localizer (scout, topogram, surview): an X-ray of the patient by the scanner itself, row by row, in the frame
// of reference of the CT (PS3.3 C.8.2.1.1.1, Image Type value 3 LOCALIZER; docs/algorithms.md, "Line scans").

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "geometry/xray_image.h"
#include "io/dicom/identity.h"
#include "io/dicom/notes.h"

namespace isoshift {

// Where the tube stood, seen from the patient. Files do not tell: the plane of the image has two sides.
enum class TubeSide { kLeft, kRight, kAnterior, kPosterior };
inline constexpr std::array kTubeSides = {TubeSide::kLeft, TubeSide::kRight, TubeSide::kAnterior, TubeSide::kPosterior};
std::string_view to_string(TubeSide side);
std::optional<TubeSide> tube_side_from(std::string_view name);

// What a person supplies where the file lacks it.
struct ScoutSwitches {
  std::optional<double> sad_mm, sid_mm;
};

struct Scout {
  Identity identity;
  std::string sop_instance_uid, frame_of_reference_uid, sha256;
  std::string patient_position;  // annotation only (C.7.3.1.1.2); may be empty
  Image<float> values;           // they grow with the attenuation along the ray; scale and offset are the scanner's own
  Eigen::Vector3d first_pixel_patient_mm = Eigen::Vector3d::Zero();  // ImagePositionPatient
  Eigen::Vector3d column_step_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d row_step_patient_mm = Eigen::Vector3d::Zero();  // along the table
  double sad_mm = 0.0, sid_mm = 0.0;

  // The two sides of its plane on which the tube can have stood.
  std::array<TubeSide, 2> possible_sides() const;
  // With the tube on one of them, over the middle of the rows.
  XrayImage xray(TubeSide side, const Eigen::Isometry3d& room_from_patient) const;
};

// Throws Error for anything but a localizer, for a plane that is not that of a scan along the patient's z axis, and for
// distances that neither file nor switches supply.
Scout read_scout(const std::filesystem::path& path, const ScoutSwitches& switches, Notes& notes);

}  // namespace isoshift
