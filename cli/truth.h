#pragma once
// Setup errors from files, and how far a result lies from the known one of a phantom study.

#include <Eigen/Geometry>
#include <filesystem>
#include <string>

namespace isoshift {

// The setup error of a result.json, or of a truth.json as `isoshift phantom` writes it. Throws Error naming what is
// missing, also for a result that is not fully determined.
Eigen::Isometry3d read_setup_error(const std::filesystem::path& path);

// Mean target registration error: the mean distance, over the 27 points {-50, 0, 50}^3 mm about the isocenter, between
// where two setup errors put them (van de Kraats et al. 2005; docs/algorithms.md).
double mean_target_registration_error_mm(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth);

// A table for a person: found, true and difference per axis, and the mean target registration error.
std::string compared_with_truth(const Eigen::Isometry3d& found_error, const Eigen::Isometry3d& true_error);

}  // namespace isoshift
