#include "registration/quality/contradiction.h"

#include <algorithm>
#include <cmath>

#include "geometry/target_error.h"
#include "registration/objective.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

// Of gradient correlation per mm^2 of a parameter: 0.001 at 10 mm. What a view sees holds it a hundred times as firmly.
constexpr double kSpring = 1e-5;
constexpr double kReachMm = 15.0, kFirstStepMm = 1.0;

// Gradient correlation less the spring, on top of a pose.
class HeldObjective {
 public:
  HeldObjective(Objective& objective, const Eigen::Isometry3d& pose) : objective_(objective), pose_(pose) {}

  std::vector<double> values(std::span<const std::vector<double>> points) {
    std::vector<double> values = objective_.values(poses_of(points));
    for (std::size_t n = 0; n < points.size(); ++n) values[n] -= 0.5 * kSpring * vector_of(points[n]).squaredNorm();
    return values;
  }

  std::vector<QuadraticModel> models(std::span<const std::vector<double>> points) {
    std::vector<QuadraticModel> models = objective_.models(poses_of(points));
    for (std::size_t n = 0; n < points.size(); ++n) {
      const Eigen::VectorXd at = vector_of(points[n]);
      const QuadraticModel spring{.value = -0.5 * at.squaredNorm(),
                                  .gradient = -at,
                                  .curvature = Eigen::MatrixXd::Identity(at.size(), at.size())};
      models[n] = weighted_sum(1.0, models[n].by(motions_per_parameter(points[n])), kSpring, spring);
    }
    return models;
  }

 private:
  std::vector<Eigen::Isometry3d> poses_of(std::span<const std::vector<double>> points) const {
    std::vector<Eigen::Isometry3d> poses;
    for (const std::vector<double>& point : points) poses.push_back(setup_error_from_parameters(point) * pose_);
    return poses;
  }
  static Eigen::VectorXd vector_of(const std::vector<double>& point) {
    return Eigen::Map<const Eigen::VectorXd>(point.data(), static_cast<Eigen::Index>(point.size()));
  }

  Objective& objective_;
  const Eigen::Isometry3d& pose_;
};

// The pose that one view wants.
Eigen::Isometry3d wanted_alone(Renderer& renderer, const FixedImage& image, const Eigen::Isometry3d& pose, Dof dof) {
  Objective objective(renderer, std::span(&image, 1), pose,
                      {.similarity = SimilarityKind::kGradientCorrelation, .pixel_fraction = 0.5, .min_pixels = 6000});
  HeldObjective held(objective, pose);
  const std::size_t axes = dof == Dof::kRigid ? 6 : 3;
  OptimizerOptions options{.start = std::vector<double>(axes, 0.0),
                           .lower = std::vector<double>(axes, -kReachMm),
                           .upper = std::vector<double>(axes, kReachMm),
                           .initial_step = std::vector<double>(axes, kFirstStepMm),
                           .relative_tolerance = 0.02,
                           .max_evaluations = 100};
  using Points = std::span<const std::vector<double>>;
  std::vector<OptimizerResult> found;
  if (renderer.has_derivatives()) {
    options.kind = OptimizerKind::kLevenbergMarquardt;
    found = maximize([&](Points points) { return held.models(points); }, std::span(&options, 1));
  } else {
    found = maximize([&](Points points) { return held.values(points); }, std::span(&options, 1));
  }
  return setup_error_from_parameters(found.front().best) * pose;
}

// Root mean square over the standard targets of how far they move in a view, mm at the isocenter.
double seen_distance_mm(const XrayView& view, const Eigen::Isometry3d& setup_error, const Eigen::Isometry3d& other) {
  double squares = 0.0, count = 0.0;
  for (const Eigen::Vector3d& target : standard_targets_mm()) {
    const auto here = view.project(setup_error * target), there = view.project(other * target);
    if (!here || !there) continue;
    squares += (*here - *there).squaredNorm();
    count += 1.0;
  }
  return count > 0.0 ? std::sqrt(squares / count) / pixels_per_mm(view) : 0.0;
}

}  // namespace

std::vector<double> contradictions(const RendererPyramid& renderers, const FixedViews& views,
                                   const Eigen::Isometry3d& planned_room_from_patient,
                                   const Eigen::Isometry3d& room_from_patient, const Stage& last_stage, Dof dof) {
  if (views.images.size() < 2) return {};
  constexpr double kPixelMm = 2.0;
  const double pixel_mm = std::max(kPixelMm, last_stage.pixel_mm);
  Renderer& renderer = renderers.with_voxels_up_to(std::max(kPixelMm, last_stage.voxel_mm));
  const Eigen::Isometry3d error = room_from_patient * planned_room_from_patient.inverse();
  std::vector<double> distances_mm;
  for (const FixedImage& image : views.reduced_to(pixel_mm, room_from_patient, 0.0)) {
    const Eigen::Isometry3d alone = wanted_alone(renderer, image, room_from_patient, dof);
    distances_mm.push_back(seen_distance_mm(image.view, alone * planned_room_from_patient.inverse(), error));
  }
  return distances_mm;
}

}  // namespace isoshift
