#pragma once
// Setup errors as JSON, like those in result.json: {"translation_mm": [x, y, z], "rotation_matrix": [row, row, row]}.

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

namespace isoshift {

nlohmann::json json_of_setup_error(const Eigen::Isometry3d& setup_error);

// Throws nlohmann::json::exception for a missing or incomplete number, and Error for a matrix that is no rotation.
Eigen::Isometry3d setup_error_from(const nlohmann::json& json);

}  // namespace isoshift
