#pragma once
// A case as an exported study: RT Plan, RT Structure Set with the PTV at the isocenter, two RT Images, and the truth.

#include <filesystem>
#include <vector>

#include "tests/real_data/campaign/case_plan.h"
#include "tests/real_data/campaign/patient.h"

namespace isoshift::campaign {

// Into an existing folder. `images`: what expose() gave for each view.
void write_case(const CasePlan& plan, const Patient& patient, const Deformation& deformation,
                const std::vector<std::vector<float>>& images, const std::filesystem::path& folder);

}  // namespace isoshift::campaign
