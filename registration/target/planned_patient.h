#pragma once
// The patient of a registration for a target: the CT, and where the plan puts it.

#include <Eigen/Geometry>
#include <memory>

#include "geometry/volume.h"

namespace isoshift {

struct PlannedPatient {
  std::shared_ptr<const Volume<float>> ct_hu;
  Eigen::Isometry3d room_from_patient = Eigen::Isometry3d::Identity();  // as planned

  Eigen::Vector3d isocenter_patient_mm() const { return room_from_patient.inverse().translation(); }
};

}  // namespace isoshift
