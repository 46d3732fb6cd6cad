#include "registration/bodies/turned_views.h"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "geometry/linear_algebra.h"
#include "registration/bodies/body_objective.h"
#include "registration/bodies/pose_slots.h"
#include "registration/objective.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

// By a motion of the patient in the room, about the isocenter (mm and rad).
struct PoseInView {
  Eigen::Isometry3d room_from_patient;
  double value = 0.0;  // the logarithm of the probability of the view
  Eigen::VectorXd gradient;
  Eigen::MatrixXd curvature;

  Eigen::VectorXd step() const { return solve_symmetric(curvature, gradient); }
};

}  // namespace

class TurnedViews::Implementation {
 public:
  Implementation(const BodyScene& scene, const BodyPoses& found)
      : scene_(scene),
        level_(scene.views.reduced_to(BodyStage().pixel_mm, found.front().front(), 0.0)),
        pixels_(*scene.fine.as_one, level_, found.front().front(),
                {.similarity = SimilarityKind::kGradientCorrelation}),
        objective_(scene.bodies, scene.fine.apart, pixels_, BodyStage().tile_mm),
        as_whole_(parts_at(at_one_pose(scene, scene.whole_room_from_patient))) {
    const BodyObjective::Parts as_bodies = parts_at(found);
    by_bodies_ = as_bodies.springs.value;
    for (std::size_t view = 0; view < level_.size(); ++view)
      by_bodies_ += as_bodies.views[view].value - as_whole_.views[view].value;
  }

  std::size_t views() const { return level_.size(); }
  double by_bodies() const { return by_bodies_; }

  // `ways`: how the patient may move (6 x 6).
  PoseInView whole(std::size_t view, const Eigen::MatrixXd& ways) const {
    return in_view(as_whole_, scene_.whole_room_from_patient, view, ways);
  }
  PoseInView at(const Eigen::Isometry3d& room_from_patient, std::size_t view, const Eigen::MatrixXd& ways) {
    return in_view(parts_at(at_one_pose(scene_, room_from_patient)), room_from_patient, view, ways);
  }

  // The most probable pose in one view alone, by Gauss-Newton steps.
  PoseInView most_probable_from(PoseInView here, std::size_t view, const Eigen::MatrixXd& ways) {
    constexpr int kMostSteps = 6, kMostHalvings = 3;
    constexpr double kLeastGain = 0.5;
    for (int step = 0; step < kMostSteps; ++step) {
      const double before = here.value;
      Eigen::VectorXd motion = here.step();
      for (int halving = 0; halving < kMostHalvings; ++halving, motion *= 0.5) {
        std::vector<double> parameters(motion.begin(), motion.end());
        for (std::size_t n = 3; n < 6; ++n) parameters[n] *= kLeverMm;
        PoseInView there = at(setup_error_from_parameters(parameters) * here.room_from_patient, view, ways);
        if (there.value <= before) continue;
        here = std::move(there);
        break;
      }
      if (here.value - before < kLeastGain) break;
    }
    return here;
  }

 private:
  BodyObjective::Parts parts_at(const BodyPoses& poses) {
    const PoseSlots slots(scene_.bodies, scene_.fine.apart, poses);
    return objective_.parts(slots, std::vector<double>(PoseSlots::kParameters * slots.count(), 0.0));
  }

  PoseInView in_view(const BodyObjective::Parts& parts, const Eigen::Isometry3d& room_from_patient, std::size_t view,
                     const Eigen::MatrixXd& ways) const {
    const PoseSlots slots(scene_.bodies, scene_.fine.apart, at_one_pose(scene_, room_from_patient));
    const std::vector<double> at_base(PoseSlots::kParameters * slots.count(), 0.0);
    const QuadraticModel& by_slots = parts.views[view];
    Eigen::MatrixXd together(by_slots.gradient.size(), 6);
    for (std::size_t slot = 0; slot < slots.count(); ++slot)
      together.middleRows<6>(static_cast<Eigen::Index>(6 * slot)) =
          product(inverse(slots.motions(slot, at_base)), ways);
    // What the view does not see is held.
    Eigen::VectorXd held = Eigen::VectorXd::Constant(6, kSpringOfOneView);
    held.tail<3>() *= kLeverMm * kLeverMm;
    return {.room_from_patient = room_from_patient,
            .value = by_slots.value,
            .gradient = transposed_product(together, by_slots.gradient),
            .curvature = pulled_back(together, by_slots.curvature) + Eigen::MatrixXd(held.asDiagonal())};
  }

  const BodyScene& scene_;
  const std::vector<FixedImage> level_;
  const Objective pixels_;
  BodyObjective objective_;
  const BodyObjective::Parts as_whole_;
  double by_bodies_ = 0.0;
};

TurnedViews::TurnedViews(const BodyScene& scene, const BodyPoses& found)
    : implementation_(std::make_unique<Implementation>(scene, found)) {}
TurnedViews::~TurnedViews() = default;

double TurnedViews::share_explained_by(const TurnBetweenViews& turn) {
  Implementation& patient = *implementation_;
  Eigen::MatrixXd ways = Eigen::MatrixXd::Identity(6, 6);
  ways.topLeftCorner<3, 3>() -= turn.axis_room * turn.axis_room.transpose();
  double by_turn = 0.0;
  for (std::size_t view = 0; view < patient.views(); ++view) {
    const PoseInView whole = patient.whole(view, ways), turned = patient.at(turn.room_from_patient[view], view, ways);
    by_turn += std::max(patient.most_probable_from(turned, view, ways).value,
                        patient.most_probable_from(whole, view, ways).value) -
               whole.value;
  }
  return patient.by_bodies() > 0.0 ? by_turn / patient.by_bodies() : 1.0;
}

ViewsApart TurnedViews::apart(std::span<const Eigen::Isometry3d> wanted) {
  // Where the geometry of one view was wrong, poses gained up to 1.4 times what the first step promised.
  constexpr double kPromisedToGained = 2.0;
  Implementation& patient = *implementation_;
  const Eigen::MatrixXd ways = Eigen::MatrixXd::Identity(6, 6);
  std::vector<PoseInView> starts;
  double before = 0.0, promised = 0.0;
  for (std::size_t view = 0; view < patient.views(); ++view) {
    PoseInView whole = patient.whole(view, ways), alone = patient.at(wanted[view], view, ways);
    before += whole.value;
    starts.push_back(alone.value > whole.value ? std::move(alone) : std::move(whole));
    promised += starts.back().value + 0.5 * starts.back().gradient.dot(starts.back().step());
  }
  double gain = promised - before;
  if (kPromisedToGained * gain >= limits::kMostShareApart * patient.by_bodies()) {
    gain = -before;
    for (std::size_t view = 0; view < patient.views(); ++view)
      gain += patient.most_probable_from(starts[view], view, ways).value;
  }
  return {.gain = gain, .share_of_bodies_gain = patient.by_bodies() > 0.0 ? gain / patient.by_bodies() : 1.0};
}

}  // namespace isoshift
