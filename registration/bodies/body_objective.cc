#include "registration/bodies/body_objective.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "geometry/rotation.h"
#include "registration/preprocess/preprocess.h"
#include "registration/similarity/correlation_model.h"

namespace isoshift {
namespace {

using Eigen::Index;

constexpr double kLeastCovered = 0.05;  // of a tile: fewer pixels fit anything
constexpr double kLeastRest = 1e-4;     // of 1 - rho: DRRs of a phantom can match without rest
constexpr std::size_t kTilesOfARun = 64;

// One direction of the gradients.
struct Direction {
  std::vector<float> Gradients::* xray;
  std::uint32_t Neighbors::* from;
  std::uint32_t Neighbors::* to;
};
constexpr std::array kDirections = {Direction{&Gradients::along_row, &Neighbors::left, &Neighbors::right},
                                    Direction{&Gradients::along_column, &Neighbors::above, &Neighbors::below}};

// A spring's stretch in sigmas, and how motions of its two bodies (about the isocenter, in the room) change it.
struct Stretch {
  Eigen::Matrix<double, 6, 1> sigmas;
  Eigen::Matrix<double, 6, 6> by_a, by_b;
};

Stretch stretch_of(const JointedBodies::Spring& spring, const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Vector3d on_a = a * spring.at_patient_mm, on_b = b * spring.at_patient_mm;
  Stretch stretch;
  stretch.sigmas << (on_a - on_b) / spring.sigma_mm,
      rotation_vector(a.linear() * b.linear().transpose()) / spring.sigma_rad;
  stretch.by_a.setZero();
  stretch.by_a.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / spring.sigma_mm;
  stretch.by_a.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() / spring.sigma_rad;
  stretch.by_b = -stretch.by_a;
  stretch.by_a.topRightCorner<3, 3>() = -cross_matrix(on_a) / spring.sigma_mm;
  stretch.by_b.topRightCorner<3, 3>() = cross_matrix(on_b) / spring.sigma_mm;
  return stretch;
}

QuadraticModel no_model(std::size_t parameters) {
  const auto count = static_cast<Index>(parameters);
  return {.value = 0.0, .gradient = Eigen::VectorXd::Zero(count), .curvature = Eigen::MatrixXd::Zero(count, count)};
}

}  // namespace

BodyObjective::BodyObjective(const JointedBodies& bodies, const BodyRenderers& renderers, const Objective& pixels,
                             double tile_mm)
    : bodies_(bodies), pixels_(pixels) {
  for (std::size_t view = 0; view < pixels.views().size(); ++view) {
    const XrayView& camera = pixels.views()[view];
    drrs_.emplace_back(renderers, camera, pixels.rendered_pixels(view));
    for (Tile& tile : tiles_of(camera, pixels.compared_pixels(view), tile_mm)) {
      if (tile.covered < kLeastCovered) continue;
      if (runs_.empty() || runs_.back().view != view || runs_.back().tiles.size() == kTilesOfARun)
        runs_.push_back({.view = view, .tiles = {}});
      runs_.back().tiles.push_back(std::move(tile));
    }
  }
}

// Adds what a tile says, by the motions of the slots.
void BodyObjective::add_tile(std::size_t view, const Tile& tile, const PoseSlots& slots,
                             QuadraticModel& by_motions) const {
  const Comparison& comparison = pixels_.comparison(view);
  const std::span<const Neighbors> neighbors = comparison.neighbors();
  const MovingBodies& drr = drrs_[view];
  std::vector<std::size_t> present;  // bodies
  for (std::size_t body = 0; body < drr.count(); ++body)
    if (std::ranges::any_of(tile.compared, [&](std::uint32_t n) {
          return drr.covers(body, neighbors[n].left) || drr.covers(body, neighbors[n].right) ||
                 drr.covers(body, neighbors[n].above) || drr.covers(body, neighbors[n].below);
        }))
      present.push_back(body);
  const auto rows = static_cast<Index>(tile.compared.size()), columns = static_cast<Index>(6 * present.size());
  for (const Direction& direction : kDirections) {
    Eigen::VectorXf x(rows), y(rows);
    PixelJacobian of_y(rows, columns);
    for (Index n = 0; n < rows; ++n) {
      const std::uint32_t at = tile.compared[static_cast<std::size_t>(n)];
      const std::uint32_t from = neighbors[at].*direction.from, to = neighbors[at].*direction.to;
      x[n] = (comparison.xray_gradients().*direction.xray)[at];
      y[n] = drr.line_integrals()[to] - drr.line_integrals()[from];
      for (std::size_t b = 0; b < present.size(); ++b)
        of_y.row(n).segment<6>(static_cast<Index>(6 * b)) = drr.derivatives_between(present[b], from, to).transpose();
    }
    const QuadraticModel correlation = correlation_model(std::move(x), std::move(y), std::move(of_y));
    const double weight = 0.25 * tile.covered;  // half of n/2, with n the share covered
    const double rest = std::max(kLeastRest, 1.0 - correlation.value);
    by_motions.value -= weight * std::log(rest);
    for (std::size_t a = 0; a < present.size(); ++a) {
      const auto of_a = static_cast<Index>(6 * a), at_a = static_cast<Index>(6 * slots.of(present[a], view));
      by_motions.gradient.segment<6>(at_a) += weight / rest * correlation.gradient.segment<6>(of_a);
      for (std::size_t b = 0; b < present.size(); ++b) {
        const auto of_b = static_cast<Index>(6 * b), at_b = static_cast<Index>(6 * slots.of(present[b], view));
        by_motions.curvature.block<6, 6>(at_a, at_b) += weight / rest * correlation.curvature.block<6, 6>(of_a, of_b);
      }
    }
  }
}

std::vector<QuadraticModel> BodyObjective::view_models(const PoseSlots& slots, std::span<const double> parameters) {
  const BodyPoses poses = slots.poses(parameters);
  parallel_for(std::size_t{0}, drrs_.size(), [&](std::size_t view) {
    std::vector<Eigen::Isometry3d> in_view;
    for (const std::vector<Eigen::Isometry3d>& of_body : poses) in_view.push_back(of_body[view]);
    drrs_[view].move_to(in_view);
  });
  // Sums of fixed runs of tiles of one view: rounding must not depend on how the work is spread.
  std::vector<QuadraticModel> sums(runs_.size(), no_model(parameters.size()));
  parallel_for(std::size_t{0}, runs_.size(), [&](std::size_t run) {
    for (const Tile& tile : runs_[run].tiles) add_tile(runs_[run].view, tile, slots, sums[run]);
  });
  std::vector<QuadraticModel> views(drrs_.size(), no_model(parameters.size()));
  for (std::size_t run = 0; run < runs_.size(); ++run) views[runs_[run].view] += sums[run];
  // From motions to parameters, slot by slot.
  for (std::size_t slot = 0; slot < slots.count(); ++slot) {
    const auto at = static_cast<Index>(6 * slot);
    const Eigen::Matrix<double, 6, 6> motions = slots.motions(slot, parameters);
    for (QuadraticModel& view : views) {
      view.gradient.segment<6>(at) = motions.transpose() * view.gradient.segment<6>(at);
      view.curvature.middleRows<6>(at) = motions.transpose() * view.curvature.middleRows<6>(at);
      view.curvature.middleCols<6>(at) = view.curvature.middleCols<6>(at) * motions;
    }
  }
  return views;
}

QuadraticModel BodyObjective::spring_model(const PoseSlots& slots, std::span<const double> parameters) const {
  QuadraticModel sum = no_model(parameters.size());
  const BodyPoses poses = slots.poses(parameters);
  for (const JointedBodies::Spring& spring : bodies_.springs)
    for (std::size_t view = 0; view < slots.views(); ++view) {
      const std::size_t slot_a = slots.of(spring.a, view), slot_b = slots.of(spring.b, view);
      // A spring between two poses that hold for all views counts once.
      if (view > 0 && slot_a == slots.of(spring.a, 0) && slot_b == slots.of(spring.b, 0)) continue;
      const Stretch stretch = stretch_of(spring, poses[spring.a][view], poses[spring.b][view]);
      const Eigen::Matrix<double, 6, 6> by_a = stretch.by_a * slots.motions(slot_a, parameters);
      const Eigen::Matrix<double, 6, 6> by_b = stretch.by_b * slots.motions(slot_b, parameters);
      const auto a = static_cast<Index>(6 * slot_a), b = static_cast<Index>(6 * slot_b);
      sum.value -= 0.5 * stretch.sigmas.squaredNorm();
      sum.gradient.segment<6>(a) -= by_a.transpose() * stretch.sigmas;
      sum.gradient.segment<6>(b) -= by_b.transpose() * stretch.sigmas;
      sum.curvature.block<6, 6>(a, a) += by_a.transpose() * by_a;
      sum.curvature.block<6, 6>(b, b) += by_b.transpose() * by_b;
      sum.curvature.block<6, 6>(a, b) += by_a.transpose() * by_b;
      sum.curvature.block<6, 6>(b, a) += by_b.transpose() * by_a;
    }
  return sum;
}

QuadraticModel BodyObjective::Parts::of_all_views() const {
  QuadraticModel sum = no_model(static_cast<std::size_t>(springs.gradient.size()));
  for (const QuadraticModel& view : views) sum += view;
  return sum;
}

BodyObjective::Parts BodyObjective::parts(const PoseSlots& slots, std::span<const double> parameters) {
  return {.views = view_models(slots, parameters), .springs = spring_model(slots, parameters)};
}

QuadraticModel BodyObjective::model(const PoseSlots& slots, std::span<const double> parameters) {
  const Parts both = parts(slots, parameters);
  QuadraticModel sum = both.of_all_views();
  return sum += both.springs;
}

}  // namespace isoshift
