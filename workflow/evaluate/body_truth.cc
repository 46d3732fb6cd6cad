#include "workflow/evaluate/body_truth.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace isoshift {

std::vector<BodyTruth> read_body_truths(const std::filesystem::path& truth_json) {
  std::ifstream file(truth_json);
  if (!file) throw Error(fmt::format("{}: cannot be opened", truth_json.string()));
  try {
    const nlohmann::json json = nlohmann::json::parse(file);
    const char* const list = json.contains("bodies") ? "bodies" : "levels";
    std::vector<BodyTruth> truths;
    if (!json.contains(list)) return truths;
    for (const nlohmann::json& body : json.at(list)) {
      BodyTruth& truth = truths.emplace_back();
      for (int row = 0; row < 3; ++row) {
        truth.center_patient_mm[row] = body.at("center_patient_mm").at(row);
        truth.setup_error.translation()[row] = body.at("translation_mm").at(row);
        for (int column = 0; column < 3; ++column)
          truth.setup_error.linear()(row, column) = body.at("rotation_matrix").at(row).at(column);
      }
    }
    return truths;
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: the motions of its bodies cannot be read: {}", truth_json.string(), error.what()));
  }
}

std::vector<EvaluatedBody> compared_bodies(std::span<const BodyMotion> found, std::span<const BodyTruth> truths,
                                           const Eigen::Isometry3d& target_truth,
                                           const Eigen::Isometry3d& planned_room_from_patient) {
  constexpr double kNearMm = 25.0;
  std::vector<EvaluatedBody> compared;
  if (truths.empty()) return compared;
  for (const BodyMotion& body : found) {
    const auto distance_mm = [&](const BodyTruth& truth) {
      return (planned_room_from_patient * truth.center_patient_mm - body.center_room_mm).norm();
    };
    const BodyTruth& truth = *std::ranges::min_element(truths, {}, distance_mm);
    if (distance_mm(truth) > kNearMm) continue;
    compared.push_back(
        {.name = body.name,
         .is_determined = body.is_determined(),
         .found_mm = body.displacement_mm,
         .true_mm = target_truth.inverse() * truth.setup_error * body.center_room_mm - body.center_room_mm,
         .sigma_mm = body.sigma_mm});
  }
  return compared;
}

}  // namespace isoshift
