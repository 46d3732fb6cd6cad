#pragma once
// Where a 4D CT shows the target in each of its phases.

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "workflow/register/registration_setup.h"

namespace isoshift {

// Displacements from the planning CT, mm, IEC 61217 fixed: found as in X-rays, in DRRs of each phase from two sides.
// Throws Error for a phase of another frame of reference, or in which the target is not found.
std::vector<Eigen::VectorXd> displacements_of_phases(const std::vector<std::filesystem::path>& folders,
                                                     const Study& study, const RegistrationSetup& setup,
                                                     const RenderingOptions& rendering,
                                                     const Eigen::Vector3d& target_patient_mm,
                                                     const Allowances& allowed, Notes& notes);

}  // namespace isoshift
