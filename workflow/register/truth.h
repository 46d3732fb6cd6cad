#pragma once
// Setup errors from files, and how far a result lies from the known one of a phantom study.

#include <Eigen/Geometry>
#include <filesystem>
#include <string>

namespace isoshift {

// The setup error of a result.json, or of a truth.json as `isoshift phantom` writes it. Throws Error naming what is
// missing, also for a result that is not fully determined.
Eigen::Isometry3d read_setup_error(const std::filesystem::path& path);

// A table for a person: found, true and difference per axis, and the mean target registration error.
std::string compared_with_truth(const Eigen::Isometry3d& found_error, const Eigen::Isometry3d& true_error);

}  // namespace isoshift
