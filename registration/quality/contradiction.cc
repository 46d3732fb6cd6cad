#include "registration/quality/contradiction.h"

#include <algorithm>
#include <cmath>

#include "geometry/linear_algebra.h"
#include "geometry/rotation.h"
#include "geometry/seen_motions.h"
#include "geometry/target_error.h"
#include "registration/objective.h"
#include "registration/pose_objective.h"
#include "registration/pose_parameters.h"
#include "registration/quality/limits.h"
#include "registration/quality/uncertainty.h"

namespace isoshift {
namespace {

// Of gradient correlation per mm^2 of a parameter: 0.001 at 10 mm. What a view sees holds it a hundred times as firmly.
constexpr double kSpring = 1e-5;
constexpr double kWeakSpring = 1e-7;  // 0.001 at 100 mm
constexpr double kLargestMoveMm = 15.0, kFirstStepMm = 1.0;

// Gradient correlation less the spring, on top of a pose.
class HeldObjective {
 public:
  HeldObjective(Objective& objective, const Eigen::Isometry3d& pose) : poses_(objective, pose) {}

  std::vector<double> values(std::span<const std::vector<double>> points) {
    std::vector<double> values = poses_.values(points);
    for (std::size_t n = 0; n < points.size(); ++n) values[n] += kSpring * spring_at(points[n]).value;
    return values;
  }

  std::vector<QuadraticModel> models(std::span<const std::vector<double>> points) {
    std::vector<QuadraticModel> models = poses_.models(points);
    for (std::size_t n = 0; n < points.size(); ++n)
      models[n] = weighted_sum(1.0, models[n], kSpring, spring_at(points[n]));
    return models;
  }

 private:
  static QuadraticModel spring_at(const std::vector<double>& point) {
    const Eigen::Map<const Eigen::VectorXd> at(point.data(), static_cast<Eigen::Index>(point.size()));
    return {.value = -0.5 * at.squaredNorm(),
            .gradient = -at,
            .curvature = Eigen::MatrixXd::Identity(at.size(), at.size())};
  }

  PoseObjective poses_;
};

// The setup error that one view wants, on top of a pose: the best parameters.
std::vector<double> wanted_alone(Objective& objective, const Renderer& renderer, const Eigen::Isometry3d& pose,
                                 Dof dof) {
  HeldObjective held(objective, pose);
  const std::size_t axes = dof == Dof::kRigid ? 6 : 3;
  const OptimizerOptions options{
      .kind = possible_optimizer(OptimizerKind::kLevenbergMarquardt, renderer, SimilarityKind::kGradientCorrelation),
      .start = std::vector<double>(axes, 0.0),
      .lower = std::vector<double>(axes, -kLargestMoveMm),
      .upper = std::vector<double>(axes, kLargestMoveMm),
      .initial_step = std::vector<double>(axes, kFirstStepMm),
      .relative_tolerance = 0.02,
      .max_evaluations = 100};
  return maximize_poses(held, renderer, std::span(&options, 1)).front().best;
}

// How a view shows the standard targets with every parameter: two rows per target, mm at the isocenter.
Eigen::MatrixXd seen_of_parameters(const XrayView& view, const Eigen::Isometry3d& setup_error, std::size_t axes) {
  std::vector<Eigen::Vector3d> points = standard_targets_mm();
  for (Eigen::Vector3d& point : points) point = setup_error * point;
  SeenMotions motions = seen_motions(view, points) / pixels_per_mm(view);
  motions.rightCols<3>() /= kLeverMm;
  return motions.leftCols(static_cast<Eigen::Index>(axes));
}

// What one view alone wants, on top of the pose of all.
struct WantedAlone {
  Eigen::Vector3d looks_along;
  std::vector<double> parameters;  // PoseParameters
  Eigen::MatrixXd covariance;      // of them

  Eigen::Vector3d rotation() const { return Eigen::Map<const Eigen::Vector3d>(parameters.data() + 3); }  // times lever
  double variance_about(const Eigen::Vector3d& axis) const { return axis.dot(covariance.block<3, 3>(3, 3) * axis); }
};

std::vector<double> without_translation_along(const Eigen::Vector3d& axis, const std::vector<double>& parameters) {
  std::vector<double> without = parameters;
  Eigen::Map<Eigen::Vector3d> translation(without.data());
  translation -= translation.dot(axis) * axis;
  return without;
}

// What the view would want if no spring held it. The search ended where curvature and spring balance.
WantedMotion without_spring(const std::vector<double>& parameters, const PoseInformation& information) {
  const Eigen::Map<const Eigen::VectorXd> held(parameters.data(), static_cast<Eigen::Index>(parameters.size()));
  Eigen::Matrix<double, 6, 1> units = Eigen::Matrix<double, 6, 1>::Ones();
  units.tail<3>() /= kLeverMm;
  return {.motion = units.asDiagonal() * product(inverse(information.held_curvature(kWeakSpring)),
                                                 product(information.held_curvature(kSpring), held)),
          .covariance = units.asDiagonal() * information.covariance(kWeakSpring) * units.asDiagonal()};
}

TurnBetweenViews turn_between(const std::vector<WantedAlone>& views, const Eigen::Isometry3d& room_from_patient) {
  constexpr double kLeastAcross = 1e-6;
  TurnBetweenViews turn;
  for (std::size_t a = 0; a < views.size(); ++a)
    for (std::size_t b = a + 1; b < views.size(); ++b) {
      const Eigen::Vector3d across = views[a].looks_along.cross(views[b].looks_along);
      if (across.norm() < kLeastAcross) continue;  // opposed
      const Eigen::Vector3d axis = across.normalized();
      const double angle_rad = std::abs(axis.dot(views[a].rotation() - views[b].rotation())) / kLeverMm;
      if (angle_rad < turn.angle_rad) continue;
      turn.angle_rad = angle_rad;
      turn.sigma_rad = std::sqrt(views[a].variance_about(axis) + views[b].variance_about(axis)) / kLeverMm;
      turn.axis_room = axis;
    }
  for (const WantedAlone& view : views)
    turn.room_from_patient.push_back(
        setup_error_from_parameters(without_translation_along(turn.axis_room, view.parameters)) * room_from_patient);
  return turn;
}

}  // namespace

bool TurnBetweenViews::is_clear() const {
  return !(angle_rad <= limits::kMostTurnRad || angle_rad <= limits::kMostTurnSigmas * sigma_rad);
}

bool ViewsApart::is_clear() const {
  return !(gain <= limits::kLeastGainApart || share_of_bodies_gain <= limits::kMostShareApart);
}

Contradictions contradictions(const RendererPyramid& renderers, const FixedViews& views,
                              const Eigen::Isometry3d& planned_room_from_patient,
                              const Eigen::Isometry3d& room_from_patient, const Stage& last_stage, Dof dof) {
  if (views.images.size() < 2) return {};
  constexpr double kPixelMm = 2.0;
  const double pixel_mm = std::max(kPixelMm, last_stage.pixel_mm);
  Renderer& renderer = renderers.with_voxels_up_to(std::max(kPixelMm, last_stage.voxel_mm));
  const Eigen::Isometry3d error = room_from_patient * planned_room_from_patient.inverse();
  const auto targets = static_cast<double>(standard_targets_mm().size());
  Contradictions result;
  std::vector<WantedAlone> alone;
  for (const FixedImage& image : views.reduced_to(pixel_mm, room_from_patient, 0.0)) {
    Objective objective(
        renderer, std::span(&image, 1), room_from_patient,
        {.similarity = SimilarityKind::kGradientCorrelation, .pixel_fraction = 0.5, .min_pixels = 6000});
    const PoseInformation information = pose_information(objective, room_from_patient, dof == Dof::kTranslation);
    alone.push_back({.looks_along = image.view.central_direction_room(),
                     .parameters = wanted_alone(objective, renderer, room_from_patient, dof),
                     .covariance = information.covariance(kSpring)});
    const WantedAlone& wanted = alone.back();
    if (dof == Dof::kRigid) result.wanted.push_back(without_spring(wanted.parameters, information));
    result.wanted_room_from_patient.push_back(setup_error_from_parameters(wanted.parameters) * room_from_patient);
    const Eigen::MatrixXd motions = seen_of_parameters(image.view, error, wanted.parameters.size());
    const Eigen::Map<const Eigen::VectorXd> parameters(wanted.parameters.data(),
                                                       static_cast<Eigen::Index>(wanted.parameters.size()));
    result.of_views.push_back({.mm = product(motions, parameters).norm() / std::sqrt(targets),
                               .sigma_mm = std::sqrt(propagated(motions, wanted.covariance).trace() / targets)});
  }
  if (dof == Dof::kRigid) result.turn = turn_between(alone, room_from_patient);
  return result;
}

}  // namespace isoshift
