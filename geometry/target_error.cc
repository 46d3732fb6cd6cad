#include "geometry/target_error.h"

#include <limits>

namespace isoshift {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

template <class Distance>
double mean_over(std::span<const Vector3d> targets_mm, Distance&& distance_mm) {
  double sum_mm = 0.0;
  for (const Vector3d& target_mm : targets_mm) sum_mm += distance_mm(target_mm);
  return sum_mm / static_cast<double>(targets_mm.size());
}

}  // namespace

std::vector<Vector3d> standard_targets_mm() {
  std::vector<Vector3d> targets_mm;
  for (const double x : {-50.0, 0.0, 50.0})
    for (const double y : {-50.0, 0.0, 50.0})
      for (const double z : {-50.0, 0.0, 50.0}) targets_mm.emplace_back(x, y, z);
  return targets_mm;
}

double mean_target_registration_error_mm(const Isometry3d& found, const Isometry3d& truth,
                                         std::span<const Vector3d> targets_mm) {
  return mean_over(targets_mm, [&](const Vector3d& target) { return (found * target - truth * target).norm(); });
}

double mean_projection_distance_mm(const Isometry3d& found, const Isometry3d& truth,
                                   std::span<const Vector3d> targets_mm, const XrayView& view) {
  return mean_over(targets_mm, [&](const Vector3d& target) {
    const auto at_found = view.project(found * target), at_truth = view.project(truth * target);
    if (!at_found || !at_truth) return std::numeric_limits<double>::infinity();
    return (view.ray(at_found->x(), at_found->y()).pixel_room_mm - view.ray(at_truth->x(), at_truth->y()).pixel_room_mm)
        .norm();
  });
}

double mean_reprojection_distance_mm(const Isometry3d& found, const Isometry3d& truth,
                                     std::span<const Vector3d> targets_mm, const XrayView& view) {
  return mean_over(targets_mm, [&](const Vector3d& target) {
    const Vector3d source = view.source_for_mm(found * target);
    const Vector3d way = (found * target - source).normalized();
    const Vector3d from_source = truth * target - source;
    return (from_source - from_source.dot(way) * way).norm();
  });
}

double rotation_share(const Isometry3d& found, const Isometry3d& truth, std::span<const Vector3d> targets_mm) {
  const Isometry3d error = found * truth.inverse();
  const double translation_mm = error.translation().norm();
  const double rotation_mm =
      mean_over(targets_mm, [&](const Vector3d& target) { return (error.linear() * target - target).norm(); });
  return rotation_mm + translation_mm > 0.0 ? rotation_mm / (rotation_mm + translation_mm) : 0.0;
}

}  // namespace isoshift
