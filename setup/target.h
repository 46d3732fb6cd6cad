#pragma once
// What a setup must bring right: the volume that the plan treats.

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/patient_setup.h"
#include "setup/registration.h"

namespace isoshift {

constexpr std::string_view kIsocenterSurroundings = "the isocenter's surroundings";  // the target where no structure is

// Places are where they were planned: mm from the isocenter, IEC 61217 fixed.
struct Target {
  std::string name;       // of the structure, or kIsocenterSurroundings and how far they reach
  std::string chosen_by;  // in words: "dose reference 1 of the plan", "--target"
  std::string surrogate;  // what of it X-rays show, in words: "bone within 20 mm"; empty: not looked for
  Eigen::Vector3d center_room_mm = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> extent_room_mm;  // points of its surface, farthest in directions all around
};

// How far anatomy planned at a point lies from its plan.
Eigen::Vector3d displacement_mm(const Eigen::Isometry3d& setup_error, const Eigen::Vector3d& point_room_mm);

}  // namespace isoshift
