#include "workflow/register/setup_error_json.h"

#include <fmt/format.h>

#include <array>
#include <optional>

#include "base/error.h"
#include "base/json_file.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

// The angles beside a matrix, of R = Rz Rx Ry, in the forms of result.json and of truth.json.
std::optional<std::array<double, 3>> angles_deg_in(const nlohmann::json& json) {
  if (json.contains("rotation_deg_rx_ry_rz")) return json.at("rotation_deg_rx_ry_rz").get<std::array<double, 3>>();
  if (!json.contains("rotation_deg") || !json.at("rotation_deg").is_object()) return std::nullopt;
  const nlohmann::json& angles = json.at("rotation_deg");
  return std::array{angles.at("rx").get<double>(), angles.at("ry").get<double>(), angles.at("rz").get<double>()};
}

// A person who edits the angles and not the matrix means another pose than a program reads.
void check_angles(const nlohmann::json& json, const Eigen::Matrix3d& rotation) {
  constexpr double kMostDeg = 0.05;  // as people round them
  const auto angles_deg = angles_deg_in(json);
  if (!angles_deg) return;
  const auto [x, y, z] = *angles_deg;
  const Eigen::Matrix3d by_angles =
      rotation_from_zxy({.z_rad = rad_from_deg(z), .x_rad = rad_from_deg(x), .y_rad = rad_from_deg(y)});
  const double apart_deg = deg_from_rad(Eigen::AngleAxisd(by_angles.transpose() * rotation).angle());
  if (!(apart_deg <= kMostDeg))
    throw Error(
        fmt::format("its angles ({}, {}, {}) degrees about x, y and z (R = Rz Rx Ry) contradict its rotation_matrix, "
                    "which is {:.2f} degrees away: change both, or leave the angles out",
                    x, y, z, apart_deg));
}

}  // namespace

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
  check_angles(json, setup_error.linear());
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
