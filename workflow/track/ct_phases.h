#pragma once
// The position of the target in each phase of a 4D CT.

#include <Eigen/Core>
#include <filesystem>
#include <vector>

#include "workflow/register/registration_setup.h"

namespace isoshift {

// Displacements of the target from the planning CT, mm, IEC 61217 fixed. DRRs of each phase from two sides are
// registered like X-rays. Throws Error for a phase in another frame of reference, or in which the target is not found.
std::vector<Eigen::VectorXd> displacements_of_phases(const std::vector<std::filesystem::path>& folders,
                                                     const Study& study, const RegistrationSetup& setup,
                                                     const RenderingOptions& rendering,
                                                     const Eigen::Vector3d& target_patient_mm,
                                                     const Allowances& allowed, Notes& notes);

}  // namespace isoshift
