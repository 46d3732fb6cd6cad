#include "registration/imager/imager_effect.h"

#include <map>
#include <vector>

#include "geometry/linear_algebra.h"
#include "geometry/target_error.h"

namespace isoshift {

SeenBy seen_by(const ImagerModel& model) {
  constexpr double kStep = 1e-3;
  const std::vector<Eigen::Vector3d> points = standard_targets_mm();
  SeenBy seen{.motions = seen_motions([&](const Eigen::Vector3d& point) { return model.pixel_of(point, {}); }, points),
              .errors = Eigen::MatrixXd(static_cast<Eigen::Index>(2 * points.size()), kImagerParameters)};
  for (std::size_t n = 0; n < points.size(); ++n)
    for (std::size_t parameter = 0; parameter < kImagerParameters; ++parameter) {
      ImagerErrors errors{};
      errors[parameter] = kStep;
      seen.errors.block<2, 1>(static_cast<Eigen::Index>(2 * n), static_cast<Eigen::Index>(parameter)) =
          (model.pixel_of(points[n], errors) - model.pixel_of(points[n], {})) / kStep;
    }
  return seen;
}

Uncertainty uncertainty_by_imagers(std::span<const ImagerInView> views, Dof dof) {
  std::vector<SeenBy> seen;
  Eigen::Index rows = 0;
  for (const ImagerInView& view : views) {
    seen.push_back(seen_by(view.model));
    rows += seen.back().motions.rows();
  }
  // Everything in mm at the isocenter, so that views with small pixels do not count more.
  std::map<std::size_t, Eigen::MatrixXd> by_errors;
  Eigen::MatrixXd by_motions(rows, 6);
  Eigen::Index row = 0;
  for (std::size_t n = 0; n < views.size(); ++n) {
    const Eigen::Index count = seen[n].motions.rows();
    by_motions.middleRows(row, count) = seen[n].motions / views[n].pixels_per_mm;
    const auto of_imager =
        by_errors.try_emplace(views[n].imager.number, Eigen::MatrixXd::Zero(rows, kImagerParameters)).first;
    const ImagerErrors left = views[n].imager.left();
    of_imager->second.middleRows(row, count) =
        seen[n].errors / views[n].pixels_per_mm *
        Eigen::Map<const Eigen::Matrix<double, kImagerParameters, 1>>(left.data()).asDiagonal();
    row += count;
  }
  const Eigen::Index axes = dof == Dof::kRigid ? 6 : 3;
  Uncertainty uncertainty;
  for (const auto& [imager, errors] : by_errors) {
    const Eigen::MatrixXd motions = least_squares(by_motions.leftCols(axes), errors);
    uncertainty.covariance.topLeftCorner(axes, axes) += product(motions, motions.transpose());
  }
  return uncertainty;
}

}  // namespace isoshift
