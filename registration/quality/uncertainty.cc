#include "registration/quality/uncertainty.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/parallel.h"
#include "geometry/linear_algebra.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

constexpr double kCorrelationMm = 25.0;  // residuals are alike over about this distance, at the isocenter

// What the sandwich leaves out: errors common to all tiles, such as those of the model of beam and scatter, and of
// voxels of finite size. The factor and the floors bring the share of true errors within one and two sigma to about 68
// and 95 % over the cases of docs/evaluation.md.
constexpr double kCalibration = 1.2;
constexpr double kFloorVoxels = 0.03, kFloorMm = 0.025;
// What overlaps a volume of interest has edges of its own, which may all pull the same way: the spine of
// `chest-breathing` lay at 2 to 3.4 sigma on four axes.
constexpr double kOverlap = 2.0;

using Values = Eigen::Map<const Eigen::VectorXf>;
Values values_of(std::span<const float> list) { return {list.data(), static_cast<Eigen::Index>(list.size())}; }

// Line integrals of all views at a pose, and how they change with its parameters.
class Linearized {
 public:
  Linearized(Objective& objective, const Eigen::Isometry3d& pose, int axes)
      : drrs_(objective.has_derivatives() ? objective.render_with_derivatives(std::span(&pose, 1))
                                          : objective.render(poses_around(pose, axes))),
        has_derivatives_(objective.has_derivatives()),
        axes_(axes) {}

  std::span<const float> line_integrals(std::size_t view) const { return drrs_.line_integrals(0, view); }

  PixelJacobian jacobian(std::size_t view) const {
    if (has_derivatives_) {
      const std::vector<double> at_the_pose(static_cast<std::size_t>(axes_), 0.0);
      return pixel_jacobian(drrs_.derivatives(0, view)) * motions_per_parameter(at_the_pose).cast<float>();
    }
    PixelJacobian jacobian(static_cast<Eigen::Index>(line_integrals(view).size()), axes_);
    for (int axis = 0; axis < axes_; ++axis) {
      const std::size_t before = 2 * static_cast<std::size_t>(axis) + 1;
      jacobian.col(axis) =
          (values_of(drrs_.line_integrals(before + 1, view)) - values_of(drrs_.line_integrals(before, view))) /
          static_cast<float>(2.0 * kStepMm);
    }
    return jacobian;
  }

 private:
  static constexpr double kStepMm = 0.3;  // of central differences, also of rotations, on the sphere of kLeverMm

  // The pose itself, and for each axis the poses a step before and after it.
  static std::vector<Eigen::Isometry3d> poses_around(const Eigen::Isometry3d& pose, int axes) {
    std::vector<Eigen::Isometry3d> poses = {pose};
    for (int axis = 0; axis < axes; ++axis)
      for (const double step : {-kStepMm, kStepMm}) {
        std::vector<double> parameters(static_cast<std::size_t>(axes), 0.0);
        parameters[static_cast<std::size_t>(axis)] = step;
        poses.push_back(setup_error_from_parameters(parameters) * pose);
      }
    return poses;
  }

  RenderResult drrs_;
  bool has_derivatives_;
  int axes_;
};

Eigen::VectorXd centered(std::span<const float> list) {
  Eigen::VectorXd values = values_of(list).cast<double>();
  values.array() -= values.mean();
  return values;
}

// A list, centered and of unit norm, and how that changes with the parameters; zeros where the list is constant.
struct Normalized {
  Eigen::VectorXd values;
  Eigen::MatrixXd derivative;
};
Normalized normalized(std::span<const float> list, const PixelJacobian& jacobian) {
  Normalized result{.values = centered(list), .derivative = jacobian.cast<double>()};
  const double norm = result.values.norm();
  if (!(norm > 0.0)) return {.values = result.values, .derivative = 0.0 * result.derivative};
  result.values /= norm;
  result.derivative.rowwise() -= result.derivative.colwise().mean().eval();
  result.derivative /= norm;
  result.derivative -= product(result.values, transposed_product(result.values, result.derivative));
  return result;
}

// The curvature and the scatter, summed over views and directions.
struct Sandwich {
  Eigen::MatrixXd curvature, scatter;
  Eigen::Index tiles = 0;
};

// For each pixel compared, the number of its tile among those that have pixels.
std::vector<Eigen::Index> tiles_of(std::span<const std::uint32_t> pixels, const XrayView& camera) {
  const int tile_px = std::max(1, static_cast<int>(std::lround(kCorrelationMm * pixels_per_mm(camera))));
  std::map<int, Eigen::Index> numbers;
  std::vector<Eigen::Index> tiles;
  tiles.reserve(pixels.size());
  for (const std::uint32_t pixel : pixels) {
    const int column = static_cast<int>(pixel) % camera.columns, row = static_cast<int>(pixel) / camera.columns;
    const int place = row / tile_px * camera.columns + column / tile_px;
    tiles.push_back(numbers.try_emplace(place, static_cast<Eigen::Index>(numbers.size())).first->second);
  }
  return tiles;
}

// What one view adds.
Sandwich sandwich_of(const Objective& objective, std::size_t view, const Linearized& drrs, int axes) {
  Sandwich sandwich{.curvature = Eigen::MatrixXd::Zero(axes, axes), .scatter = Eigen::MatrixXd::Zero(axes, axes)};
  const Comparison& comparison = objective.comparison(view);
  const std::vector<Eigen::Index> tiles = tiles_of(objective.compared_pixels(view), objective.views()[view]);
  sandwich.tiles = tiles.empty() ? 0 : *std::ranges::max_element(tiles) + 1;
  const Gradients drr = gradients(drrs.line_integrals(view), comparison.neighbors());
  const GradientJacobians change = gradient_jacobians(drrs.jacobian(view), comparison.neighbors());
  Eigen::MatrixXd scores = Eigen::MatrixXd::Zero(axes, sandwich.tiles);
  const auto add = [&](std::span<const float> of_xray, std::span<const float> of_drr, const PixelJacobian& jacobian) {
    const Eigen::VectorXd x = centered(of_xray).normalized();
    const Normalized d = normalized(of_drr, jacobian);
    // What does not correlate at all does not bend the similarity.
    sandwich.curvature += x.dot(d.values) * transposed_product(d.derivative, d.derivative);
    const Eigen::VectorXd residual = x - d.values;
    for (Eigen::Index n = 0; n < residual.size(); ++n)
      scores.col(tiles[static_cast<std::size_t>(n)]) += residual[n] * d.derivative.row(n).transpose();
  };
  add(comparison.xray_gradients().along_row, drr.along_row, change.along_row);
  add(comparison.xray_gradients().along_column, drr.along_column, change.along_column);
  sandwich.scatter = product(scores, scores.transpose());
  return sandwich;
}

Sandwich sandwich_at(Objective& objective, const Eigen::Isometry3d& pose, int axes) {
  const Linearized drrs(objective, pose, axes);
  std::vector<Sandwich> of_views(objective.views().size());
  parallel_for(std::size_t{0}, of_views.size(),
               [&](std::size_t view) { of_views[view] = sandwich_of(objective, view, drrs, axes); });
  Sandwich sum{.curvature = Eigen::MatrixXd::Zero(axes, axes), .scatter = Eigen::MatrixXd::Zero(axes, axes)};
  for (const Sandwich& of_view : of_views) {
    sum.curvature += of_view.curvature;
    sum.scatter += of_view.scatter;
    sum.tiles += of_view.tiles;
  }
  return sum;
}

// Sandwiches of few tiles are too thin.
double small_sample(const Sandwich& sandwich, int axes) {
  return sandwich.tiles > axes ? static_cast<double>(sandwich.tiles) / static_cast<double>(sandwich.tiles - axes) : 1e6;
}

}  // namespace

Eigen::MatrixXd PoseInformation::held_curvature(double spring) const {
  return curvature + spring * Eigen::MatrixXd::Identity(curvature.rows(), curvature.cols());
}

Eigen::MatrixXd PoseInformation::covariance(double spring) const {
  return propagated(inverse(held_curvature(spring)), scatter);
}

PoseInformation pose_information(Objective& objective, const Eigen::Isometry3d& room_from_patient,
                                 bool translation_only) {
  const int axes = translation_only ? 3 : 6;
  const Sandwich sandwich = sandwich_at(objective, room_from_patient, axes);
  // Gradient correlation is the mean over the views and both directions, the curvature their sum.
  const double lists = 2.0 * static_cast<double>(objective.views().size());
  return {.curvature = sandwich.curvature / lists,
          .scatter = small_sample(sandwich, axes) / (lists * lists) * sandwich.scatter};
}

std::optional<Uncertainty> estimated_uncertainty(Objective& objective, const Eigen::Isometry3d& room_from_patient,
                                                 const UncertaintyOptions& options) {
  const int axes = options.translation_only ? 3 : 6;
  const Sandwich sandwich = sandwich_at(objective, room_from_patient, axes);
  constexpr double kSingular = 1e-6;
  const Eigen::VectorXd curvatures = symmetric_eigen(sandwich.curvature).values;
  if (!(curvatures.minCoeff() > kSingular * curvatures.maxCoeff())) return std::nullopt;
  const Eigen::MatrixXd covariance =
      small_sample(sandwich, axes) * propagated(inverse(sandwich.curvature), sandwich.scatter);
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
