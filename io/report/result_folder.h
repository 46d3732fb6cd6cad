#pragma once
// A result as files. result.json and the pictures contain everything; every other format can be made from them.

#include <filesystem>

#include "setup/setup_result.h"

namespace isoshift {

inline constexpr const char* kResultFile = "result.json";
inline constexpr const char* kRegistrationFile = "spatial_registration.dcm";

// Writes result.json, report.txt, report.csv, report.pdf, report.html, report.dcm, and the pictures of each view.
void write_result(const SetupResult& report, const std::filesystem::path& folder);

// Reads a result without pictures. Throws Error naming a file that is missing or does not belong to a result.
SetupResult read_report(const std::filesystem::path& folder);

// Reads a result with pictures. Throws Error naming a file that is missing or does not belong to a result.
SetupResult read_result(const std::filesystem::path& folder);

}  // namespace isoshift
