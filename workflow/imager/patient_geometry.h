#pragma once
// The geometry of imagers from the registrations of patients (docs/commands/geometry.md).

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "registration/imager/imagers_of_patients.h"

namespace isoshift {

struct PatientGeometry {
  std::vector<std::string> imagers;  // ImagerNames::names(), as `found` has them
  std::size_t sessions = 0, cts = 0, views = 0;
  std::map<std::string, std::size_t> left_out;  // results that tell nothing: why, and how many
  ImagersOfPatients found;
};

// Of all results below a folder. Throws Error as results_below() does, and if none of them tells anything.
PatientGeometry patient_geometry(const std::filesystem::path& results);

}  // namespace isoshift
