#pragma once
// What the bones of a patient did, where somebody knows it: phantoms and simulated studies.

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "registration/evaluate.h"
#include "setup/registration.h"

namespace isoshift {

// The motion of the anatomy around a point of the CT, as a setup error.
struct BodyTruth {
  Eigen::Vector3d center_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
};

// `bodies` of a truth.json, or its `levels`; empty if it has neither. Throws Error naming the file.
std::vector<BodyTruth> read_body_truths(const std::filesystem::path& truth_json);

// What was found of every bone beside the truth of the nearest point within 25 mm of it; bones without such a point are
// left out. `target_truth`: the true setup error of the target, against which bones move.
std::vector<EvaluatedBody> compared_bodies(std::span<const BodyMotion> found, std::span<const BodyTruth> truths,
                                           const Eigen::Isometry3d& target_truth,
                                           const Eigen::Isometry3d& planned_room_from_patient);

}  // namespace isoshift
