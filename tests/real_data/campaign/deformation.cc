#include "tests/real_data/campaign/deformation.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

namespace isoshift::campaign {
namespace {

using Eigen::Vector3d;

double smooth_step(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u * u * (3.0 - 2.0 * u);
}

Eigen::Matrix3d turn_at(const Bending& bending, double distance_mm) {
  return Eigen::AngleAxisd(bending.angle_rad * smooth_step(distance_mm / bending.growth_mm), bending.axis)
      .toRotationMatrix();
}

}  // namespace

Deformation::Deformation(const std::vector<Bending>& bendings, const Breath& breath) : breath_(breath) {
  constexpr int kReachMm = 500;
  for (const Bending& bending : bendings) {
    if (bending.angle_rad == 0.0) continue;
    Table table{.bending = bending, .planned_from_deformed = {}};
    const Vector3d along = bending.direction * Vector3d::UnitZ();
    Vector3d planned_mm = bending.start_mm, moved_mm = bending.start_mm;
    for (int n = 0; n <= kReachMm; ++n) {
      Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
      motion.linear() = turn_at(bending, n);
      motion.translation() = moved_mm - motion.linear() * planned_mm;
      table.planned_from_deformed.push_back(motion.inverse());
      moved_mm += turn_at(bending, n + 0.5) * along;
      planned_mm += along;
    }
    bendings_.push_back(std::move(table));
  }
}

Vector3d Deformation::unbent(const Table& table, const Vector3d& deformed_mm) {
  const Bending& bending = table.bending;
  const auto distance_of = [&](const Vector3d& point) {
    return std::clamp(bending.direction * (point.z() - bending.start_mm.z()), 0.0, 499.0);
  };
  Vector3d planned_mm = deformed_mm;
  // The motion belongs to the point's height in the CT, which is what is looked for.
  for (int iteration = 0; iteration < 40; ++iteration) {
    const double distance_mm = distance_of(planned_mm);
    const auto n = static_cast<std::size_t>(distance_mm);
    const double share = distance_mm - static_cast<double>(n);
    const Vector3d next_mm = (1.0 - share) * (table.planned_from_deformed[n] * deformed_mm) +
                             share * (table.planned_from_deformed[n + 1] * deformed_mm);
    const double change_mm = (next_mm - planned_mm).norm();
    planned_mm = next_mm;
    if (change_mm < 1e-7) break;
  }
  return planned_mm;
}

Vector3d Deformation::planned_of(const Vector3d& deformed_mm) const {
  Vector3d point_mm = deformed_mm;
  for (auto table = bendings_.rbegin(); table != bendings_.rend(); ++table) point_mm = unbent(*table, point_mm);
  if (!breath_.amplitude_mm.isZero())
    point_mm -=
        smooth_step((breath_.still_behind_mm - point_mm.y()) / (breath_.still_behind_mm - breath_.full_before_mm)) *
        breath_.amplitude_mm;
  return point_mm;
}

Vector3d Deformation::deformed_of(const Vector3d& planned_mm) const {
  Vector3d deformed_mm = planned_mm;
  for (int iteration = 0; iteration < 200; ++iteration) {
    const Vector3d miss_mm = planned_mm - planned_of(deformed_mm);
    deformed_mm += miss_mm;
    if (miss_mm.norm() < 1e-6) break;
  }
  return deformed_mm;
}

Eigen::Isometry3d Deformation::motion_near(const Vector3d& planned_mm) const {
  constexpr double kReachMm = 5.0;
  Eigen::Matrix3d gradient;
  for (int axis = 0; axis < 3; ++axis)
    gradient.col(axis) = (deformed_of(planned_mm + kReachMm * Vector3d::Unit(axis)) -
                          deformed_of(planned_mm - kReachMm * Vector3d::Unit(axis))) /
                         (2.0 * kReachMm);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(gradient, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = svd.matrixU() * svd.matrixV().transpose();
  motion.translation() = deformed_of(planned_mm) - motion.linear() * planned_mm;
  return motion;
}

DisplacementField::DisplacementField(const Deformation& deformation, const Vector3d& low_mm, const Vector3d& high_mm)
    : low_mm_(low_mm.cast<float>()),
      size_(((high_mm - low_mm).array() / static_cast<double>(kSpacingMm)).ceil().cast<int>() + 2) {
  displacements_mm_.reserve(static_cast<std::size_t>(size_.prod()));
  for (int k = 0; k < size_.z(); ++k)
    for (int j = 0; j < size_.y(); ++j)
      for (int i = 0; i < size_.x(); ++i) {
        const Vector3d place_mm = low_mm + static_cast<double>(kSpacingMm) * Vector3d(i, j, k);
        displacements_mm_.emplace_back((deformation.planned_of(place_mm) - place_mm).cast<float>());
      }
}

Eigen::Vector3f DisplacementField::at(const Eigen::Vector3f& deformed_mm) const {
  const Eigen::Vector3f place = (deformed_mm - low_mm_) / kSpacingMm;
  if (!(place.minCoeff() >= 0.0F)) return Eigen::Vector3f::Zero();
  const Eigen::Vector3i first = place.cast<int>();
  if ((first.array() + 1 >= size_.array()).any()) return Eigen::Vector3f::Zero();
  const Eigen::Vector3f f = place - first.cast<float>();
  const auto row = static_cast<std::size_t>(size_.x()), slice = row * static_cast<std::size_t>(size_.y());
  const Eigen::Vector3f* corner =
      &displacements_mm_[static_cast<std::size_t>(first.z()) * slice + static_cast<std::size_t>(first.y()) * row +
                         static_cast<std::size_t>(first.x())];
  const auto line = [&](std::size_t n) -> Eigen::Vector3f { return corner[n] + f.x() * (corner[n + 1] - corner[n]); };
  const auto plane = [&](std::size_t n) -> Eigen::Vector3f { return line(n) + f.y() * (line(n + row) - line(n)); };
  return plane(0) + f.z() * (plane(slice) - plane(0));
}

}  // namespace isoshift::campaign
