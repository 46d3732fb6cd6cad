#pragma once
// Setup errors from files, and the difference between a result and the known setup error of a phantom study.

#include <Eigen/Geometry>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace isoshift {

// The setup error of a result.json, or of a truth.json as `isoshift phantom` writes it. Throws Error naming a missing
// value, and for a result in which a component is not determined.
Eigen::Isometry3d read_setup_error(const std::filesystem::path& path);

// The motion of the anatomy around a point of the CT, as a setup error.
struct BodyTruth {
  Eigen::Vector3d center_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
};

// `bodies` of a truth.json, or its `levels`; empty if it has neither, and for a result.json. Throws Error naming the
// file.
std::vector<BodyTruth> read_body_truths(const std::filesystem::path& path);

// The true setup error of the anatomy at a point: the body's whose center is nearest; `at_isocenter` where the
// isocenter is nearer still, or no body is known.
Eigen::Isometry3d truth_at(const Eigen::Vector3d& point_patient_mm, const Eigen::Isometry3d& at_isocenter,
                           const Eigen::Vector3d& isocenter_patient_mm, std::span<const BodyTruth> bodies);

// A table for a person: found, true and difference per axis, and the mean target registration error.
std::string compared_with_truth(const Eigen::Isometry3d& found_error, const Eigen::Isometry3d& true_error);

}  // namespace isoshift
