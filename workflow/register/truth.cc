#include "workflow/register/truth.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_file.h"
#include "geometry/rotation.h"
#include "geometry/target_error.h"
#include "workflow/register/setup_error_json.h"

namespace isoshift {

namespace {

Eigen::Vector3d vector_from(const nlohmann::json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

}  // namespace

Eigen::Isometry3d read_setup_error(const std::filesystem::path& path) {
  return setup_error_in(read_json_file(path).json, path.string());
}

std::vector<BodyTruth> read_body_truths(const std::filesystem::path& path) {
  const nlohmann::json json = read_json_file(path).json;
  try {
    std::vector<BodyTruth> truths;
    const char* const list = json.contains("bodies") ? "bodies" : "levels";
    if (json.contains("setup_error") || !json.contains(list)) return truths;
    for (const nlohmann::json& body : json.at(list))
      truths.push_back(
          {.center_patient_mm = vector_from(body.at("center_patient_mm")), .setup_error = setup_error_from(body)});
    return truths;
  } catch (const Error& error) {
    throw Error(fmt::format("{}: {}", path.string(), error.what()));
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: the motions of its bodies cannot be read: {}", path.string(), reason_of(error)));
  }
}

Eigen::Isometry3d truth_at(const Eigen::Vector3d& point_patient_mm, const Eigen::Isometry3d& at_isocenter,
                           const Eigen::Vector3d& isocenter_patient_mm, std::span<const BodyTruth> bodies) {
  const auto distance_mm = [&](const BodyTruth& body) { return (body.center_patient_mm - point_patient_mm).norm(); };
  const auto nearest = std::ranges::min_element(bodies, {}, distance_mm);
  const bool is_body =
      nearest != bodies.end() && distance_mm(*nearest) < (isocenter_patient_mm - point_patient_mm).norm();
  return is_body ? nearest->setup_error : at_isocenter;
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
