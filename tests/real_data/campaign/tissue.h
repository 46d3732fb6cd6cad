#pragma once
// What changes in a patient without moving a bone.

#include <Eigen/Core>
#include <random>

#include "tests/real_data/campaign/patient.h"

namespace isoshift::campaign {

// Air instead of what lies within this distance of the outer air, bone excepted.
void lose_weight(Patient& patient, double mm);

// Air in place of soft tissue and lung within an ellipsoid.
void put_gas(Patient& patient, const Eigen::Vector3d& center_mm, const Eigen::Vector3d& half_extent_mm);

// Fluid in the lungs behind this plane (patient y).
void put_effusion(Patient& patient, double behind_mm);

// Nothing but air outside a box: what held the patient is gone.
void clear_outside(Patient& patient, const Eigen::Vector3d& low_mm, const Eigen::Vector3d& high_mm);

// A rod of metal, as bright as a scanner shows it.
void put_metal(Patient& patient, const Eigen::Vector3d& begin_mm, const Eigen::Vector3d& end_mm, double radius_mm);

}  // namespace isoshift::campaign
