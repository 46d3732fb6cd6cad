#include "registration/bodies/turned_views.h"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "registration/bodies/body_objective.h"
#include "registration/bodies/pose_slots.h"
#include "registration/objective.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

// Of the logarithm of probability, per mm^2 at the lever: 1 at 14 mm. It holds what a view alone does not see.
constexpr double kSpring = 0.01;

// The logarithm of the probability of every view, and of the springs.
BodyObjective::Parts parts_at(const BodyScene& scene, BodyObjective& objective, const BodyPoses& poses) {
  const PoseSlots slots(scene.bodies, scene.fine.apart, poses);
  return objective.parts(slots, std::vector<double>(PoseSlots::kParameters * slots.count(), 0.0));
}

// The most probable pose of the whole patient in one view alone, by Gauss-Newton steps. Translations along `axis` are
// not tried: anatomy that breathes moves along it.
class PoseInOneView {
 public:
  PoseInOneView(const BodyScene& scene, BodyObjective& objective, std::size_t view, const Eigen::Vector3d& axis)
      : scene_(scene), objective_(objective), view_(view), ways_(Eigen::MatrixXd::Identity(6, 6)) {
    ways_.topLeftCorner<3, 3>() -= axis * axis.transpose();
  }

  // The logarithm of the probability of that view there.
  double most_probable_from(Eigen::Isometry3d room_from_patient) {
    constexpr int kMostSteps = 6, kMostHalvings = 3;
    constexpr double kLeastGain = 0.5;
    Model here = model_at(room_from_patient);
    for (int step = 0; step < kMostSteps; ++step) {
      const double before = here.value;
      Eigen::VectorXd motion = here.curvature.ldlt().solve(here.gradient);
      for (int halving = 0; halving < kMostHalvings; ++halving, motion *= 0.5) {
        std::vector<double> parameters(motion.begin(), motion.end());
        for (std::size_t n = 3; n < 6; ++n) parameters[n] *= kLeverMm;
        const Eigen::Isometry3d moved = setup_error_from_parameters(parameters) * room_from_patient;
        Model there = model_at(moved);
        if (there.value <= before) continue;
        here = std::move(there);
        room_from_patient = moved;
        break;
      }
      if (here.value - before < kLeastGain) break;
    }
    return here.value;
  }

 private:
  // By a motion of the patient in the room, about the isocenter (mm and rad).
  struct Model {
    double value = 0.0;
    Eigen::VectorXd gradient;
    Eigen::MatrixXd curvature;
  };

  Model model_at(const Eigen::Isometry3d& room_from_patient) const {
    const PoseSlots slots(scene_.bodies, scene_.fine.apart, at_one_pose(scene_, room_from_patient));
    const std::vector<double> at_base(PoseSlots::kParameters * slots.count(), 0.0);
    const QuadraticModel by_slots = objective_.parts(slots, at_base).views[view_];
    Eigen::MatrixXd together(by_slots.gradient.size(), 6);
    for (std::size_t slot = 0; slot < slots.count(); ++slot)
      together.middleRows<6>(static_cast<Eigen::Index>(6 * slot)) = slots.motions(slot, at_base).inverse() * ways_;
    // What the view does not see is held.
    Eigen::VectorXd held = Eigen::VectorXd::Constant(6, kSpring);
    held.tail<3>() *= kLeverMm * kLeverMm;
    return {.value = by_slots.value,
            .gradient = together.transpose() * by_slots.gradient,
            .curvature = together.transpose() * by_slots.curvature * together + Eigen::MatrixXd(held.asDiagonal())};
  }

  const BodyScene& scene_;
  BodyObjective& objective_;
  std::size_t view_;
  Eigen::MatrixXd ways_;
};

}  // namespace

double share_explained_by_turn(const BodyScene& scene, const TurnBetweenViews& turn, const BodyPoses& found) {
  const BodyStage stage;
  const Eigen::Isometry3d& about = found.front().front();
  const std::vector<FixedImage> level = scene.views.reduced_to(stage.pixel_mm, about, 0.0);
  const Objective pixels(*scene.fine.as_one, level, about, {.similarity = SimilarityKind::kGradientCorrelation});
  BodyObjective objective(scene.bodies, scene.fine.apart, pixels, stage.tile_mm);
  const BodyObjective::Parts as_whole = parts_at(scene, objective, at_one_pose(scene, scene.whole_room_from_patient));
  const BodyObjective::Parts as_bodies = parts_at(scene, objective, found);
  double by_turn = 0.0, by_bodies = as_bodies.springs.value;
  for (std::size_t view = 0; view < level.size(); ++view) {
    PoseInOneView alone(scene, objective, view, turn.axis_room);
    by_bodies += as_bodies.views[view].value - as_whole.views[view].value;
    by_turn += std::max(alone.most_probable_from(turn.room_from_patient[view]),
                        alone.most_probable_from(scene.whole_room_from_patient)) -
               as_whole.views[view].value;
  }
  return by_bodies > 0.0 ? by_turn / by_bodies : 1.0;
}

}  // namespace isoshift
