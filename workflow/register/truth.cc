#include "workflow/register/truth.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "geometry/rotation.h"
#include "geometry/target_error.h"

namespace isoshift {

Eigen::Isometry3d read_setup_error(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw Error(fmt::format("{}: cannot be opened", path.string()));
  try {
    const nlohmann::json json = nlohmann::json::parse(file);
    const nlohmann::json& error = json.contains("setup_error") ? json.at("setup_error") : json.at("setup_error_room");
    Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
    for (int row = 0; row < 3; ++row) {
      setup_error.translation()[row] = error.at("translation_mm").at(row);
      for (int column = 0; column < 3; ++column)
        setup_error.linear()(row, column) = error.at("rotation_matrix").at(row).at(column);
    }
    return setup_error;
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: holds no complete setup error (a result.json or truth.json is needed): {}",
                            path.string(), error.what()));
  }
}

namespace {

// A number that rounds to nothing is shown without a sign.
double unsigned_zero(double value) { return std::abs(value) < 0.005 ? 0.0 : value; }

}  // namespace

std::string compared_with_truth(const Eigen::Isometry3d& found_error, const Eigen::Isometry3d& true_error) {
  static constexpr std::array kAxes = {"x", "y", "z"};
  const auto angles_deg = [](const Eigen::Isometry3d& error) {
    const ZxyAngles angles = zxy_from_rotation(error.linear());
    return std::array{deg_from_rad(angles.x_rad), deg_from_rad(angles.y_rad), deg_from_rad(angles.z_rad)};
  };
  std::string table = "SETUP ERROR BESIDE THE TRUTH\n                       found      true   difference\n";
  for (int axis = 0; axis < 3; ++axis) {
    const double found = found_error.translation()[axis], known = true_error.translation()[axis];
    table += fmt::format("  {:<14} {:>11.2f} {:>9.2f} {:>9.2f} mm\n", kAxes[axis], found, known,
                         unsigned_zero(found - known));
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double found = angles_deg(found_error)[axis], known = angles_deg(true_error)[axis];
    table += fmt::format("  {:<14} {:>11.2f} {:>9.2f} {:>9.2f} deg\n", fmt::format("about {}", kAxes[axis]), found,
                         known, unsigned_zero(found - known));
  }
  table += fmt::format("  mean target registration error, 27 points within 50 mm: {:.2f} mm\n",
                       mean_target_registration_error_mm(found_error, true_error, standard_targets_mm()));
  return table;
}

}  // namespace isoshift
