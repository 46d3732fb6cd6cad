#pragma once
// Whether the views contradict each other: a patient who moved between them, a gantry angle, receptor or distance that
// is not what one of the files says, anatomy that moved against the rest (docs/algorithms.md, "Contradiction").

#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "registration/search.h"

namespace isoshift {

// How far two views, each by itself, would turn the patient against each other about the axis that neither of them
// looks along: what a wrong gantry angle in one of them does. Near the isocenter nothing moves in the images by that,
// so that their contradiction is small in mm. Of more views, the two that want the largest turn.
struct TurnBetweenViews {
  double angle_rad = 0.0, sigma_rad = 0.0;
  Eigen::Vector3d axis_room = Eigen::Vector3d::Zero();
  // Of each view: the pose that it alone wants, but for a translation along the axis. Anatomy that breathes moves along
  // it, and geometry that turns about it does not.
  std::vector<Eigen::Isometry3d> room_from_patient;
  // How much of the probability that bodies gain over the rigid whole the views gain that are turned; nothing as long
  // as no bodies were searched.
  std::optional<double> share_of_bodies_gain;

  bool is_clear() const;  // by limits.h
};

// What the rigid patient gains in probability (in nats) at a pose of its own in every view, beside what bodies gain.
struct ViewsApart {
  double gain = 0.0, share_of_bodies_gain = 0.0;

  bool is_clear() const;  // by limits.h
};

struct Contradictions {
  std::vector<Contradiction> of_views;                      // empty for a single view
  std::vector<Eigen::Isometry3d> wanted_room_from_patient;  // the pose that each of them alone wants
  std::vector<WantedMotion> wanted;                         // the same without the spring; empty for translations only
  TurnBetweenViews turn;                                    // none if only translations are searched
};

// For each view: how far it alone would want anatomy from where all views together put it. The pose that the view alone
// wants is searched from the pose found, by gradient correlation; depth, which it hardly sees, is held by a weak
// spring. The distance is the root mean square over the 27 points {-50, 0, 50}^3 mm about the isocenter, as the view
// sees it: in mm at the isocenter. Its sigma is what the residuals of that view let expect of views that agree
// (uncertainty.h).
Contradictions contradictions(const RendererPyramid& renderers, const FixedViews& views,
                              const Eigen::Isometry3d& planned_room_from_patient,
                              const Eigen::Isometry3d& room_from_patient, const Stage& last_stage, Dof dof);

}  // namespace isoshift
