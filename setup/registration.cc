#include "setup/registration.h"

#include <algorithm>
#include <numeric>

#include "geometry/rotation.h"

namespace isoshift {

int ViewConsistency::with_signal() const {
  return static_cast<int>(std::ranges::count_if(parts, &ViewPart::has_signal));
}

int ViewConsistency::disagreeing() const {
  return static_cast<int>(std::ranges::count_if(parts, &ViewPart::disagrees));
}

Eigen::Vector3d Uncertainty::sigma_translation_mm() const { return covariance.diagonal().head<3>().cwiseSqrt(); }

Eigen::Matrix3d Uncertainty::covariance_at_mm2(const Eigen::Vector3d& found_room_mm) const {
  const Eigen::Matrix<double, 3, 6> per_motion = place_per_motion(found_room_mm);
  return per_motion * covariance * per_motion.transpose();
}

Eigen::Vector3d Uncertainty::sigma_at_mm(const Eigen::Vector3d& found_room_mm) const {
  return covariance_at_mm2(found_room_mm).diagonal().cwiseSqrt();
}

Eigen::Vector3d Uncertainty::sigma_rotation_rad() const { return covariance.diagonal().tail<3>().cwiseSqrt(); }

Uncertainty uncertainty_of_independent_axes(const Eigen::Vector3d& translation_mm,
                                            const Eigen::Vector3d& rotation_rad) {
  Uncertainty uncertainty;
  uncertainty.covariance.diagonal() << translation_mm.cwiseAbs2(), rotation_rad.cwiseAbs2();
  return uncertainty;
}

bool BodyMotion::is_determined() const {
  constexpr double kMostSigmaMm = 2.0, kLeastShare = 0.1;
  return (sigma_mm.array() <= kMostSigmaMm).all() && image_share >= kLeastShare;
}

int Registration::evaluations() const {
  return std::accumulate(stages.begin(), stages.end(), 0,
                         [](int sum, const StageReport& stage) { return sum + stage.evaluations; });
}

}  // namespace isoshift
