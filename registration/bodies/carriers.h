#pragma once
// The bones that carry a target: X-rays hardly show soft tissue, so that the answer for a target is theirs.

#include <span>
#include <vector>

#include "registration/bodies/body_search.h"
#include "registration/bodies/patient_bodies.h"
#include "setup/target.h"

namespace isoshift {

// Where bodies put a target: its rigid motion (setup error), the covariance of that motion (in the room, about the
// isocenter, in the units of MotionDerivatives), and how far its surface lies from where that motion puts it.
struct CarriedTarget {
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double deformation_mm = 0.0;  // at most
  double image_share = 0.0;     // of what is known about its center
  double left_mm = 0.0;         // how far the search would still move its center
};

inline constexpr double kCarriersNearMm = 20.0;

class Carriers {
 public:
  // Bones carry a target if they lie within 20 mm of its center or surface; the nearer they are, the larger their
  // shares. Where a person names the carriers by their shares (`named` is not empty), these alone do.
  Carriers(const PatientBodies& patient, const Target& target, const Eigen::Isometry3d& planned_room_from_patient,
           const std::vector<double>& named);

  // Whether bones lie that near.
  bool exist() const { return !at_center_.empty(); }

  // The share of each body, soft tissue included (0); they add up to 1.
  std::span<const double> shares() const { return at_center_; }

  // The body that carries most.
  std::size_t largest() const;

  // The target's motion with bodies at some poses.
  Eigen::Isometry3d setup_error_at(const BodyPoses& poses) const;
  CarriedTarget target_at(const BodyPoses& poses, const BodyCertainty& certainty) const;

  // How far bodies at some poses put the target from where a rigid motion does, brought back by that motion: its
  // center, and its surface at most.
  struct Off {
    Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();
    double most_mm = 0.0;
  };
  Off off_from(const Eigen::Isometry3d& setup_error, const BodyPoses& poses) const;

  // How the target moves with the motions of all bodies (BodyCertainty::covariance): 6 x 6n.
  Eigen::MatrixXd motion_per_motions() const;

 private:
  // Where a place planned at a point lies, with these shares of the bodies.
  Eigen::Vector3d moved(const Eigen::Vector3d& point_room_mm, std::span<const double> shares,
                        const BodyPoses& poses) const;

  Eigen::Isometry3d planned_;
  Eigen::Vector3d center_room_mm_;
  std::vector<Eigen::Vector3d> extent_room_mm_;
  std::vector<double> at_center_;
  std::vector<std::vector<double>> at_extent_;
};

}  // namespace isoshift
