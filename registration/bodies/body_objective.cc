#include "registration/bodies/body_objective.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/parallel.h"
#include "geometry/rotation.h"
#include "registration/preprocess/preprocess.h"
#include "registration/similarity/correlation_model.h"

namespace isoshift {
namespace {

using Eigen::Index;

constexpr double kTileMm = 25.0;     // residuals are alike over about this distance, at the isocenter
constexpr double kOutlying = 1.5;    // a tile this many times as badly explained as the median begins to lose weight
constexpr double kLeastRest = 1e-4;  // of 1 - rho: DRRs of a phantom can match without rest

// A spring's stretch in sigmas, and how motions of its two bodies (about the isocenter, in the room) change it.
struct Stretch {
  Eigen::Matrix<double, 6, 1> sigmas;
  Eigen::Matrix<double, 6, 6> by_a, by_b;
};

Stretch stretch_of(const JointedBodies::Spring& spring, const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Vector3d on_a = a * spring.at_patient_mm, on_b = b * spring.at_patient_mm;
  const Eigen::AngleAxisd turn(a.linear() * b.linear().transpose());
  Stretch stretch;
  stretch.sigmas << (on_a - on_b) / spring.sigma_mm, turn.angle() * turn.axis() / spring.sigma_rad;
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

BodyObjective::BodyObjective(const JointedBodies& bodies, const BodyRenderers& renderers, const Objective& pixels)
    : bodies_(bodies), renderers_(renderers), pixels_(pixels) {
  for (std::size_t view = 0; view < pixels.views().size(); ++view) {
    const Gradients& xray = pixels.comparison(view).xray_gradients();
    lists_.push_back({view, xray.along_row, &Neighbors::left, &Neighbors::right});
    lists_.push_back({view, xray.along_column, &Neighbors::above, &Neighbors::below});
    const XrayView& camera = pixels.views()[view];
    const int tile_px = std::max(1, static_cast<int>(std::lround(kTileMm * pixels_per_mm(camera))));
    std::map<int, std::size_t> numbers;
    std::vector<std::size_t>& tiles = tile_of_.emplace_back();
    for (const std::uint32_t pixel : pixels.compared_pixels(view)) {
      const int column = static_cast<int>(pixel) % camera.columns, row = static_cast<int>(pixel) / camera.columns;
      const int place = row / tile_px * camera.columns + column / tile_px;
      tiles.push_back(numbers.try_emplace(place, numbers.size()).first->second);
    }
    tile_weights_.emplace_back(numbers.size(), 1.0);
  }
}

BodyObjective::Drr BodyObjective::drr_of(std::size_t view, const BodyPoses& poses) const {
  const std::span<const std::uint32_t> pixels = pixels_.rendered_pixels(view);
  Drr drr{.line_integrals = std::vector<float>(pixels.size()), .jacobian = {}};
  for (std::size_t body = 0; body < renderers_.count(); ++body)
    renderers_.add(body, pixels_.views()[view], poses[body][view], pixels, drr.line_integrals);
  return drr;
}

BodyObjective::Drr BodyObjective::drr_with_jacobian(std::size_t view, const PoseSlots& slots,
                                                    std::span<const double> parameters) const {
  constexpr int kParameters = PoseSlots::kParameters;
  const BodyPoses poses = slots.poses(parameters);
  const std::span<const std::uint32_t> pixels = pixels_.rendered_pixels(view);
  const auto rows = static_cast<Index>(pixels.size());
  Drr drr{.line_integrals = std::vector<float>(pixels.size()),
          .jacobian = PixelJacobian::Zero(rows, static_cast<Index>(parameters.size()))};
  std::vector<MotionDerivatives> derivatives(pixels.size());
  for (std::size_t body = 0; body < renderers_.count(); ++body) {
    renderers_.add(body, pixels_.views()[view], poses[body][view], pixels, drr.line_integrals, derivatives);
    const std::size_t slot = slots.of(body, view);
    const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 6, Eigen::RowMajor>> by_motion(
        derivatives.front().data(), rows, 6);
    drr.jacobian.middleCols<kParameters>(static_cast<Index>(kParameters * slot)) +=
        by_motion * slots.motions(slot, parameters).cast<float>();
  }
  return drr;
}

double BodyObjective::tiles_counted(std::size_t view) const {
  double sum = 0.0;
  for (const double weight : tile_weights_[view]) sum += weight;
  return sum;
}

QuadraticModel BodyObjective::list_model(const List& list, const Drr& drr) const {
  const std::span<const Neighbors> neighbors = pixels_.comparison(list.view).neighbors();
  const auto rows = static_cast<Index>(neighbors.size());
  Eigen::VectorXf x(rows), y(rows);
  Eigen::MatrixXf of_y(rows, drr.jacobian.cols());
  for (Index n = 0; n < rows; ++n) {
    const auto at = static_cast<std::size_t>(n);
    const auto root = static_cast<float>(std::sqrt(tile_weights_[list.view][tile_of_[list.view][at]]));
    const std::uint32_t from = neighbors[at].*list.from, to = neighbors[at].*list.to;
    x[n] = root * list.xray[at];
    y[n] = root * (drr.line_integrals[to] - drr.line_integrals[from]);
    of_y.row(n) = root * (drr.jacobian.row(to) - drr.jacobian.row(from));
  }
  const QuadraticModel correlation = correlation_model(std::move(x), std::move(y), std::move(of_y));
  const double tiles = 0.25 * tiles_counted(list.view);  // half of n/2
  const double rest = std::max(kLeastRest, 1.0 - correlation.value);
  return {.value = -tiles * std::log(rest),
          .gradient = tiles / rest * correlation.gradient,
          .curvature = tiles / rest * correlation.curvature};
}

QuadraticModel BodyObjective::image_model(const PoseSlots& slots, std::span<const double> parameters) const {
  std::vector<Drr> drrs;
  for (std::size_t view = 0; view < pixels_.views().size(); ++view)
    drrs.push_back(drr_with_jacobian(view, slots, parameters));
  std::vector<QuadraticModel> parts(lists_.size());
  parallel_for(std::size_t{0}, lists_.size(),
               [&](std::size_t n) { parts[n] = list_model(lists_[n], drrs[lists_[n].view]); });
  QuadraticModel sum = no_model(parameters.size());
  for (const QuadraticModel& part : parts) sum = weighted_sum(1.0, sum, 1.0, part);
  return sum;
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

BodyObjective::Parts BodyObjective::parts(const PoseSlots& slots, std::span<const double> parameters) const {
  return {.images = image_model(slots, parameters), .springs = spring_model(slots, parameters)};
}

QuadraticModel BodyObjective::model(const PoseSlots& slots, std::span<const double> parameters) const {
  const Parts both = parts(slots, parameters);
  return weighted_sum(1.0, both.images, 1.0, both.springs);
}

void BodyObjective::reweight(const BodyPoses& poses) {
  for (std::size_t view = 0; view < pixels_.views().size(); ++view) {
    const Drr drr = drr_of(view, poses);
    const std::span<const Neighbors> neighbors = pixels_.comparison(view).neighbors();
    std::vector<double> unexplained(tile_weights_[view].size()), all(tile_weights_[view].size());
    for (const List& list : lists_) {
      if (list.view != view) continue;
      std::vector<double> y;
      double xy = 0.0, yy = 0.0;
      for (std::size_t n = 0; n < neighbors.size(); ++n) {
        y.push_back(drr.line_integrals[neighbors[n].*list.to] - drr.line_integrals[neighbors[n].*list.from]);
        const double weight = tile_weights_[view][tile_of_[view][n]];
        xy += weight * y[n] * list.xray[n];
        yy += weight * y[n] * y[n];
      }
      const double scale = yy > 0.0 ? xy / yy : 0.0;
      for (std::size_t n = 0; n < neighbors.size(); ++n) {
        const double x = list.xray[n], found = scale * y[n];
        unexplained[tile_of_[view][n]] += (x - found) * (x - found);
        all[tile_of_[view][n]] += 0.5 * (x * x + found * found);
      }
    }
    for (std::size_t tile = 0; tile < all.size(); ++tile)
      unexplained[tile] = all[tile] > 0.0 ? unexplained[tile] / all[tile] : 0.0;
    std::vector<double> sorted = unexplained;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::ranges::nth_element(sorted, middle);
    for (std::size_t tile = 0; tile < all.size(); ++tile) {
      const double times = *middle > 0.0 ? unexplained[tile] / (kOutlying * *middle) : 0.0;
      tile_weights_[view][tile] = times > 1.0 ? 1.0 / (times * times) : 1.0;
    }
  }
}

}  // namespace isoshift
