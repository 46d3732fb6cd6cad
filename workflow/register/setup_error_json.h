#pragma once
// Setup errors as JSON, like those in result.json: {"translation_mm": [x, y, z], "rotation_matrix": [row, row, row]}.

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <string>

namespace isoshift {

nlohmann::json json_of_setup_error(const Eigen::Isometry3d& setup_error);

// Throws nlohmann::json::exception for a missing or incomplete number, and Error for a matrix that is no rotation or
// that contradicts the angles beside it.
Eigen::Isometry3d setup_error_from(const nlohmann::json& json);

// That of a result.json, a truth.json or a pose set by hand. Throws Error naming the file for one that has none.
Eigen::Isometry3d setup_error_in(const nlohmann::json& file, const std::string& name);

}  // namespace isoshift
