#include "workflow/evaluate/compared_bodies.h"

#include <algorithm>

namespace isoshift {

std::vector<EvaluatedBody> compared_bodies(std::span<const BodyMotion> found, std::span<const BodyTruth> truths,
                                           const Eigen::Isometry3d& target_truth,
                                           const Eigen::Isometry3d& planned_room_from_patient) {
  constexpr double kNearMm = 25.0;
  std::vector<EvaluatedBody> compared;
  if (truths.empty()) return compared;
  for (const BodyMotion& body : found) {
    if (body.breathes) continue;
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
