#pragma once
// What was found of every bone beside what it did, where somebody knows that: in phantoms and simulated studies.

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "registration/evaluate.h"
#include "setup/registration.h"
#include "workflow/register/truth.h"

namespace isoshift {

// Every bone is compared with the truth of the nearest point within 25 mm of it; bones without such a point, and those
// that breathe, are left out. `target_truth`: the true setup error of the target, against which bones move.
std::vector<EvaluatedBody> compared_bodies(std::span<const BodyMotion> found, std::span<const BodyTruth> truths,
                                           const Eigen::Isometry3d& target_truth,
                                           const Eigen::Isometry3d& planned_room_from_patient);

}  // namespace isoshift
