#pragma once
// The parameters of a search for bodies: six for each pose that is searched, about the center of its body.

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "drr/bodies.h"
#include "registration/bodies/jointed_bodies.h"

namespace isoshift {

// A slot is a pose that is searched: one per body, and of bodies that breathe one per view.
class PoseSlots {
 public:
  static constexpr int kParameters = 6;  // of a slot: PoseParameters (pose_parameters.h), about the body's center

  // Parameters of 0 are the poses `base`.
  PoseSlots(const JointedBodies& bodies, const BodyRenderers& renderers, BodyPoses base);

  std::size_t count() const { return base_.size(); }
  std::size_t of(std::size_t body, std::size_t view) const { return slot_of_[body][view]; }
  std::size_t views() const { return slot_of_.front().size(); }

  BodyPoses poses(std::span<const double> parameters) const;

  // How a slot's parameters move its body: motions in the room about the isocenter, in the units of MotionDerivatives.
  Eigen::Matrix<double, 6, 6> motions(std::size_t slot, std::span<const double> parameters) const;

  // The same of the bodies in the first view: six rows per body, a column per parameter.
  Eigen::MatrixXd motions_of_bodies(std::span<const double> parameters) const;

 private:
  std::vector<std::vector<std::size_t>> slot_of_;  // [body][view]
  std::vector<Eigen::Isometry3d> base_;
  std::vector<Eigen::Vector3d> center_room_mm_;  // at the base
};

}  // namespace isoshift
