#include "workflow/register/setup_error_json.h"

#include <fmt/format.h>

#include <array>

#include "base/error.h"
#include "base/json_file.h"
#include "geometry/rotation.h"

namespace isoshift {

nlohmann::json json_of_setup_error(const Eigen::Isometry3d& setup_error) {
  const auto numbers = [](const auto& vector) { return std::array{vector[0], vector[1], vector[2]}; };
  const Eigen::Matrix3d rotation = setup_error.linear();
  return {{"translation_mm", numbers(Eigen::Vector3d(setup_error.translation()))},
          {"rotation_matrix", {numbers(rotation.row(0)), numbers(rotation.row(1)), numbers(rotation.row(2))}}};
}

Eigen::Isometry3d setup_error_from(const nlohmann::json& json) {
  const auto translation_mm = json.at("translation_mm").get<std::array<double, 3>>();
  const auto rows = json.at("rotation_matrix").get<std::array<std::array<double, 3>, 3>>();
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  setup_error.translation() = Eigen::Vector3d(translation_mm.data());
  for (std::size_t row = 0; row < rows.size(); ++row)
    setup_error.linear().row(static_cast<Eigen::Index>(row)) = Eigen::RowVector3d(rows[row].data());
  if (!as_rigid(Eigen::Affine3d(setup_error.matrix()))) throw Error("rotation_matrix is no rotation");
  return setup_error;
}

Eigen::Isometry3d setup_error_in(const nlohmann::json& file, const std::string& name) {
  try {
    return setup_error_from(file.contains("setup_error") ? file.at("setup_error") : file.at("setup_error_room"));
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", name, error.what()));
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: holds no complete setup error (a result.json or truth.json is needed): {}", name,
                            reason_of(error)));
  }
}

}  // namespace isoshift
