#pragma once
// Finds where every body of a patient lies, from a pose of the whole patient that is about right.

#include <span>
#include <vector>

#include "registration/bodies/jointed_bodies.h"
#include "registration/search.h"

namespace isoshift {

// From coarse to fine; every stage begins where the last one ended.
struct BodyStage {
  double pixel_mm = 2.0;        // the stage's pixels, at the isocenter
  double pixel_fraction = 0.8;  // share of the field's pixels compared: those with the strongest gradients
  int min_pixels = 4000;        // of every view, if the field has them
  double tile_mm = 12.0;        // edge of the tiles, at the isocenter
  // Of the springs of soft tissue: it is held at first, or it would settle where the patient as a whole was found, and
  // keep the bones there.
  double soft_sigmas = 1.0;
  double initial_step_mm = 2.0;  // of the parameters of all bodies together: first trust-region radius
  double least_gain = 0.1;       // of the logarithm of probability: the stage ends when no step promises more
  int max_evaluations = 25;
};

struct BodySearchOptions {
  std::vector<BodyStage> stages = {{.pixel_mm = 4.0,
                                    .pixel_fraction = 0.6,
                                    .min_pixels = 2000,
                                    .tile_mm = 25.0,
                                    .soft_sigmas = 0.1,
                                    .initial_step_mm = 4.0,
                                    .least_gain = 0.5},
                                   {.pixel_mm = 2.0, .least_gain = 1.0, .max_evaluations = 15},
                                   {.pixel_mm = 1.3, .tile_mm = 10.0, .initial_step_mm = 1.0}};
  double voxel_mm = 1.4;   // the CT is reduced to voxels up to this edge
  double bound_mm = 40.0;  // of every parameter and stage
};

struct BodySearchResult {
  BodyPoses poses, poses_after_first_stage;
  // Of the motions of all bodies, in the first view for those that breathe: in the room, about the isocenter, in the
  // units of MotionDerivatives, six after six. And the same if the sigmas of all springs were twice as large: what the
  // images show does not change by that.
  Eigen::MatrixXd covariance, covariance_on_loose_springs;
  Eigen::VectorXd motions_left;  // the same: how far the model would still go
  std::vector<StageReport> stages;
};

// What share of what is known about a place comes from the images, in the direction that is known least from them; the
// rest comes from springs. Covariances of the place, in mm.
double image_share(const Eigen::Matrix3d& covariance, const Eigen::Matrix3d& on_loose_springs);

// A patient whose bodies can be rendered: what searches share.
struct BodyScene {
  const JointedBodies& bodies;
  const BodyRenderers& renderers;
  Renderer& whole;  // of all bodies as one: chooses the pixels that are compared
  const FixedViews& views;
};

// From a pose of the whole patient that is about right. Throws Error where a view has too few pixels to compare.
BodySearchResult search_bodies(const BodyScene& scene, const Eigen::Isometry3d& whole_room_from_patient,
                               const BodySearchOptions& options = {}, const SearchProgress& progress = {});

}  // namespace isoshift
