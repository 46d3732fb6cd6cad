#include "registration/quality/uncertainty.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <map>

#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

constexpr double kCorrelationMm = 25.0;  // residuals are alike over about this distance, at the isocenter
constexpr double kStepMm = 0.3;          // of the differences, also of rotations on the sphere of kLeverMm

// What the sandwich leaves out: errors common to all tiles, such as those of the model of beam and scatter, and of
// voxels of finite size. The factor and the floors bring the share of true errors within one and two sigma to about 68
// and 95 % over the cases of docs/evaluation.md.
constexpr double kCalibration = 1.2;
constexpr double kFloorVoxels = 0.03, kFloorMm = 0.025;
// What overlaps a volume of interest has edges of its own, which may all pull the same way: the spine of
// `chest-breathing` lay at 2 to 3.4 sigma on four axes.
constexpr double kOverlap = 2.0;

// Centered, and of unit norm.
Eigen::VectorXd normalized(const std::vector<float>& values) {
  Eigen::VectorXd result =
      Eigen::Map<const Eigen::VectorXf>(values.data(), static_cast<Eigen::Index>(values.size())).cast<double>();
  result.array() -= result.mean();
  const double norm = result.norm();
  if (norm > 0.0) result /= norm;
  return result;
}

// The curvature and the scatter, summed over views and directions.
struct Sandwich {
  Eigen::MatrixXd curvature, scatter;
  int tiles = 0;
};

// Residuals and derivatives of one view along one direction, added to the scores of its tiles. What does not correlate
// at all does not bend the similarity.
void add(const Eigen::VectorXd& residual, const Eigen::MatrixXd& derivative, double correlation,
         std::span<const int> tile_of, Eigen::MatrixXd& curvature, std::map<int, Eigen::VectorXd>& scores) {
  curvature += correlation * derivative.transpose() * derivative;
  for (Eigen::Index n = 0; n < residual.size(); ++n) {
    auto [score, is_new] = scores.try_emplace(tile_of[static_cast<std::size_t>(n)]);
    if (is_new) score->second = Eigen::VectorXd::Zero(derivative.cols());
    score->second += residual[n] * derivative.row(n).transpose();
  }
}

Sandwich sandwich_at(Objective& objective, const Eigen::Isometry3d& pose, int axes) {
  std::vector<Eigen::Isometry3d> poses = {pose};
  for (int axis = 0; axis < axes; ++axis)
    for (const double step : {-kStepMm, kStepMm}) {
      std::vector<double> parameters(static_cast<std::size_t>(axes), 0.0);
      parameters[static_cast<std::size_t>(axis)] = step;
      poses.push_back(setup_error_from_parameters(parameters) * pose);
    }
  const RenderResult drrs = objective.render(poses);

  Sandwich sandwich{.curvature = Eigen::MatrixXd::Zero(axes, axes), .scatter = Eigen::MatrixXd::Zero(axes, axes)};
  for (std::size_t view = 0; view < objective.views().size(); ++view) {
    const Comparison& comparison = objective.comparison(view);
    const XrayView& camera = objective.views()[view];
    const int tile_px = std::max(1, static_cast<int>(std::lround(kCorrelationMm * pixels_per_mm(camera))));
    std::vector<int> tile_of;
    for (const std::uint32_t pixel : objective.compared_pixels(view)) {
      const int column = static_cast<int>(pixel) % camera.columns, row = static_cast<int>(pixel) / camera.columns;
      tile_of.push_back(row / tile_px * camera.columns + column / tile_px);
    }
    std::vector<Gradients> of_pose;
    of_pose.reserve(poses.size());
    for (std::size_t p = 0; p < poses.size(); ++p)
      of_pose.push_back(gradients(drrs.line_integrals(p, view), comparison.neighbors()));
    std::map<int, Eigen::VectorXd> scores;
    for (const auto direction : {&Gradients::along_row, &Gradients::along_column}) {
      const Eigen::VectorXd xray = normalized(comparison.xray_gradients().*direction);
      const Eigen::VectorXd drr = normalized(of_pose.front().*direction);
      Eigen::MatrixXd derivative(drr.size(), axes);
      for (int axis = 0; axis < axes; ++axis)
        derivative.col(axis) =
            (normalized(of_pose[2 * axis + 2].*direction) - normalized(of_pose[2 * axis + 1].*direction)) /
            (2.0 * kStepMm);
      add(xray - drr, derivative, xray.dot(drr), tile_of, sandwich.curvature, scores);
    }
    for (const auto& [tile, score] : scores) sandwich.scatter += score * score.transpose();
    sandwich.tiles += static_cast<int>(scores.size());
  }
  return sandwich;
}

// Sandwiches of few tiles are too thin.
double small_sample(const Sandwich& sandwich, int axes) {
  return sandwich.tiles > axes ? static_cast<double>(sandwich.tiles) / (sandwich.tiles - axes) : 1e6;
}

}  // namespace

Eigen::MatrixXd pose_covariance(Objective& objective, const Eigen::Isometry3d& room_from_patient, bool translation_only,
                                double spring) {
  const int axes = translation_only ? 3 : 6;
  Sandwich sandwich = sandwich_at(objective, room_from_patient, axes);
  // Gradient correlation is the mean over the views and both directions, the curvature their sum.
  const double lists = 2.0 * static_cast<double>(objective.views().size());
  sandwich.curvature += lists * spring * Eigen::MatrixXd::Identity(axes, axes);
  const Eigen::MatrixXd bread = sandwich.curvature.inverse();
  return small_sample(sandwich, axes) * bread * sandwich.scatter * bread;
}

std::optional<Uncertainty> estimated_uncertainty(Objective& objective, const Eigen::Isometry3d& room_from_patient,
                                                 const UncertaintyOptions& options) {
  const int axes = options.translation_only ? 3 : 6;
  const Sandwich sandwich = sandwich_at(objective, room_from_patient, axes);
  constexpr double kSingular = 1e-6;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(sandwich.curvature);
  if (!(eigen.eigenvalues().minCoeff() > kSingular * eigen.eigenvalues().maxCoeff())) return std::nullopt;
  const Eigen::MatrixXd bread = sandwich.curvature.inverse();
  const Eigen::MatrixXd covariance = small_sample(sandwich, axes) * bread * sandwich.scatter * bread;
  // From parameters to motions: rotation vectors in rad.
  Eigen::Matrix<double, 6, 1> units = Eigen::Matrix<double, 6, 1>::Ones();
  units.tail<3>() /= kLeverMm;
  const double overlap = options.has_volume_of_interest ? kOverlap : 1.0;
  const double floor_mm = std::max(kFloorMm, kFloorVoxels * options.voxel_mm);
  Uncertainty uncertainty;
  auto searched = uncertainty.covariance.topLeftCorner(axes, axes);
  searched = kCalibration * kCalibration * covariance;
  searched.diagonal().array() += floor_mm * floor_mm;
  uncertainty.covariance = overlap * overlap * units.asDiagonal() * uncertainty.covariance * units.asDiagonal();
  return uncertainty;
}

Uncertainty widened_to_spread(const Uncertainty& uncertainty, double spread_mm, double spread_rad) {
  constexpr double kSigmas = 4.0;
  // Added to what there is, and not scaled: no point may become more certain by it.
  const auto added = [](const Eigen::Vector3d& sigma, double spread) -> Eigen::Vector3d {
    const double factor = sigma.isZero() ? 1.0 : std::max(1.0, spread / (kSigmas * sigma.norm()));
    return (factor * factor - 1.0) * sigma.cwiseAbs2();
  };
  Uncertainty widened = uncertainty;
  widened.covariance.diagonal().head<3>() += added(uncertainty.sigma_translation_mm(), spread_mm);
  widened.covariance.diagonal().tail<3>() += added(uncertainty.sigma_rotation_rad(), spread_rad);
  return widened;
}

}  // namespace isoshift
