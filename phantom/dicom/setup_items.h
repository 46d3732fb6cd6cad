#pragma once
// What made-up studies write alike, whatever their geometry: items of plans and structure sets for a setup at an
// isocenter, whose target is a ball with the number 1.

#include <Eigen/Core>
#include <span>
#include <string>

#include "io/dicom/dicom_dataset.h"
#include "io/dicom/identity.h"

namespace isoshift {

struct SopInstance {
  const char* class_uid;
  std::string uid;
  const char* modality;
  std::string series_uid, frame_of_reference_uid;
};
void put_common(DicomItem dataset, const Identity& identity, const SopInstance& instance, const char* manufacturer);

struct SetupBeam {
  const char* machine;
  double sad_mm;
  int number;
  std::string name;
  double gantry_deg, couch_deg;
  Eigen::Vector3d isocenter_patient_mm;
};
void put_setup_beam(DicomItem beam, const SetupBeam& setup);

// The dose reference that names the target.
void put_target_reference(DicomItem plan);

struct BallTarget {
  std::string name;
  const char* interpreted_type;
  Eigen::Vector3d center_patient_mm;
  double radius_mm;
  int contour_points;
  Eigen::Vector3d slice_normal = Eigen::Vector3d::UnitZ();  // in the patient, at a right angle to its x axis
};
// A circle in each plane at `slices_mm` along the normal that cuts the ball, if it does so nearer to the center than
// `most_mm`.
void put_ball_target(DicomItem structures, const BallTarget& target, const std::string& frame_of_reference_uid,
                     std::span<const double> slices_mm, double most_mm);

}  // namespace isoshift
