#include "registration/bodies/pose_slots.h"

#include "geometry/linear_algebra.h"
#include "geometry/rotation.h"
#include "registration/pose_parameters.h"

namespace isoshift {

PoseSlots::PoseSlots(const JointedBodies& bodies, const BodyRenderers& renderers, BodyPoses base) {
  for (std::size_t body = 0; body < bodies.bodies.size(); ++body) {
    std::vector<std::size_t>& slots = slot_of_.emplace_back();
    for (const Eigen::Isometry3d& pose : base[body]) {
      if (slots.empty() || bodies.bodies[body].breathes) {
        base_.push_back(pose);
        center_room_mm_.push_back(pose * renderers.center_patient_mm(body));
      }
      slots.push_back(base_.size() - 1);
    }
  }
}

BodyPoses PoseSlots::poses(std::span<const double> parameters) const {
  std::vector<Eigen::Isometry3d> of_slot;
  for (std::size_t slot = 0; slot < count(); ++slot) {
    const Eigen::Translation3d center(center_room_mm_[slot]);
    of_slot.push_back(center * setup_error_from_parameters(parameters.subspan(kParameters * slot, kParameters)) *
                      center.inverse() * base_[slot]);
  }
  BodyPoses poses;
  for (const std::vector<std::size_t>& slots : slot_of_) {
    poses.emplace_back();
    for (const std::size_t slot : slots) poses.back().push_back(of_slot[slot]);
  }
  return poses;
}

Eigen::Matrix<double, 6, 6> PoseSlots::motions(std::size_t slot, std::span<const double> parameters) const {
  // Turning about a center c is turning about the isocenter and moving by c x rotation.
  Eigen::Matrix<double, 6, 6> about_isocenter = Eigen::Matrix<double, 6, 6>::Identity();
  about_isocenter.topRightCorner<3, 3>() = cross_matrix(center_room_mm_[slot]);
  return product(about_isocenter, motions_per_parameter(parameters.subspan(kParameters * slot, kParameters)));
}

Eigen::MatrixXd PoseSlots::motions_of_bodies(std::span<const double> parameters) const {
  const auto rows = static_cast<Eigen::Index>(kParameters * slot_of_.size());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(rows, static_cast<Eigen::Index>(parameters.size()));
  for (std::size_t body = 0; body < slot_of_.size(); ++body) {
    const std::size_t slot = of(body, 0);
    result.block<6, 6>(static_cast<Eigen::Index>(kParameters * body), static_cast<Eigen::Index>(kParameters * slot)) =
        motions(slot, parameters);
  }
  return result;
}

}  // namespace isoshift
