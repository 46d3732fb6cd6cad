#pragma once
// Whether a setup error in a file is about the setup of a study.

#include <nlohmann/json.hpp>
#include <string>

#include "geometry/patient_setup.h"
#include "io/study/study.h"

namespace isoshift {

// What a setup error is about: a patient who lies as planned.
struct PlannedLie {
  std::string patient_id;
  std::string patient_position;  // as PatientPosition says it
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  TableAngles table;
};
PlannedLie planned_lie(const Study& study);

// Throws Error naming `name` where a result.json, a truth.json or a pose set by hand says that it is of another
// patient, patient position, isocenter or table angle. A file need not say any of these.
void require_same_setup(const nlohmann::json& file, const std::string& name, const PlannedLie& expected);

}  // namespace isoshift
