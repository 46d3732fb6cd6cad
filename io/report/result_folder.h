#pragma once
// A result as files: result.json and the pictures hold all of it, every other format is made from them.

#include <filesystem>

#include "setup/setup_result.h"

namespace isoshift {

inline constexpr const char* kResultFile = "result.json";
inline constexpr const char* kRegistrationFile = "spatial_registration.dcm";

// Writes result.json, report.txt, report.csv, report.pdf, report.html, report.dcm, and pictures per view.
void write_result(const SetupResult& report, const std::filesystem::path& folder);

// Its numbers, without pictures. Throws Error naming the file that is missing or is none of a result.
SetupResult read_report(const std::filesystem::path& folder);

// The same with pictures. Throws Error naming the file that is missing or is none of a result.
SetupResult read_result(const std::filesystem::path& folder);

}  // namespace isoshift
