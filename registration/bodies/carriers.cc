#include "registration/bodies/carriers.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "geometry/linear_algebra.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

double to_bone_mm(const Volume<float>& distances, const Eigen::Vector3d& place_patient_mm) {
  const Eigen::Vector3d voxel = distances.patient_from_voxel.inverse() * place_patient_mm;
  const Eigen::Vector3i at = voxel.array().round().cast<int>();
  const bool inside = (at.array() >= 0).all() && (at.array() < distances.size.array()).all();
  return inside ? distances.at(at.x(), at.y(), at.z()) : std::numeric_limits<double>::infinity();
}

// Parts of 1 of all bodies; outside the CT those of `otherwise`.
std::vector<double> carried_shares(const PatientBodies& patient, const Eigen::Vector3d& place_patient_mm,
                                   const std::vector<double>& otherwise) {
  std::vector<double> shares = shares_at(patient.carried, place_patient_mm);
  const double sum = std::accumulate(shares.begin(), shares.end(), 0.0);
  if (!(sum > 0.5)) return otherwise;
  for (double& share : shares) share /= sum;
  shares.resize(patient.bodies.bodies.size());
  return shares;
}

}  // namespace

Carriers::Carriers(const PatientBodies& patient, const Target& target,
                   const Eigen::Isometry3d& planned_room_from_patient, const std::vector<double>& named)
    : planned_(planned_room_from_patient),
      center_room_mm_(target.center_room_mm),
      extent_room_mm_(target.extent_room_mm) {
  if (!named.empty()) {
    at_center_ = named;
    at_extent_.assign(extent_room_mm_.size(), at_center_);
    return;
  }
  const auto in_patient = [&](const Eigen::Vector3d& room_mm) -> Eigen::Vector3d {
    return planned_.inverse() * room_mm;
  };
  const auto is_near = [&](const Eigen::Vector3d& room_mm) {
    return to_bone_mm(patient.to_bone_mm, in_patient(room_mm)) <= kCarriersNearMm;
  };
  if (!is_near(center_room_mm_) && std::ranges::none_of(extent_room_mm_, is_near)) return;
  at_center_ = carried_shares(patient, in_patient(center_room_mm_), {});
  if (at_center_.empty()) return;
  for (const Eigen::Vector3d& point : extent_room_mm_)
    at_extent_.push_back(carried_shares(patient, in_patient(point), at_center_));
}

Eigen::MatrixXd Carriers::motion_per_motions() const {
  const auto bodies = static_cast<Eigen::Index>(at_center_.size());
  Eigen::MatrixXd per_motions(6, 6 * bodies);
  for (Eigen::Index body = 0; body < bodies; ++body)
    per_motions.middleCols<6>(6 * body) =
        at_center_[static_cast<std::size_t>(body)] * Eigen::Matrix<double, 6, 6>::Identity();
  return per_motions;
}

Eigen::Vector3d Carriers::moved(const Eigen::Vector3d& point, std::span<const double> shares,
                                const BodyPoses& poses) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t body = 0; body < shares.size(); ++body)
    if (shares[body] > 0.0) sum += shares[body] * (poses[body].front() * (planned_.inverse() * point));
  return sum;
}

Eigen::Isometry3d Carriers::setup_error_at(const BodyPoses& poses) const {
  // The mean of the carriers' rotations, about that of the largest.
  const Eigen::Matrix3d about = poses[largest()].front().linear();
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  for (std::size_t body = 0; body < at_center_.size(); ++body)
    turn += at_center_[body] * rotation_vector(poses[body].front().linear() * about.transpose());
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  setup_error.linear() = rotation_from_vector(turn) * about * planned_.linear().transpose();
  setup_error.translation() = moved(center_room_mm_, at_center_, poses) - setup_error.linear() * center_room_mm_;
  return setup_error;
}

std::size_t Carriers::largest() const {
  return static_cast<std::size_t>(std::ranges::max_element(at_center_) - at_center_.begin());
}

Carriers::Off Carriers::off_from(const Eigen::Isometry3d& setup_error, const BodyPoses& poses) const {
  const auto off_mm = [&](const Eigen::Vector3d& point, std::span<const double> shares) -> Eigen::Vector3d {
    return setup_error.inverse() * moved(point, shares, poses) - point;
  };
  Off off{.center_mm = off_mm(center_room_mm_, at_center_)};
  for (std::size_t n = 0; n < extent_room_mm_.size(); ++n)
    off.most_mm = std::max(off.most_mm, off_mm(extent_room_mm_[n], at_extent_[n]).norm());
  return off;
}

CarriedTarget Carriers::target_at(const BodyPoses& poses, const BodyCertainty& certainty) const {
  CarriedTarget target{.setup_error = setup_error_at(poses)};
  target.deformation_mm = off_from(target.setup_error, poses).most_mm;
  const Eigen::MatrixXd per_motions = motion_per_motions();
  target.covariance = propagated(per_motions, certainty.covariance);
  const Eigen::MatrixXd to_center = product(place_per_motion(target.setup_error * center_room_mm_), per_motions);
  target.image_share = image_share(propagated(to_center, certainty.covariance),
                                   propagated(to_center, certainty.covariance_on_loose_springs));
  target.left_mm = product(to_center, certainty.motions_left).norm();
  return target;
}

}  // namespace isoshift
