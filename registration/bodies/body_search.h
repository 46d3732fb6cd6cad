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
  int max_evaluations = 20;
};

struct BodySearchOptions {
  std::vector<BodyStage> stages = {{.pixel_mm = 4.0,
                                    .pixel_fraction = 0.6,
                                    .min_pixels = 2000,
                                    .tile_mm = 25.0,
                                    .soft_sigmas = 0.1,
                                    .initial_step_mm = 4.0},
                                   {.pixel_mm = 2.0},
                                   {.pixel_mm = 1.3, .tile_mm = 10.0, .initial_step_mm = 1.0}};
  double voxel_mm = 1.4;    // the CT is reduced to voxels up to this edge
  double bound_mm = 40.0;   // of every parameter and stage
  double least_gain = 0.1;  // of the logarithm of probability: a stage ends when no step promises more
};

struct BodySearchResult {
  BodyPoses poses;
  // Of the motions of all bodies, in the first view for those that breathe: in the room, about the isocenter, in the
  // units of MotionDerivatives, six after six. Its own share of what is known about a body's place in the direction
  // that is known least; springs and neighbors are the rest.
  Eigen::MatrixXd covariance;
  std::vector<double> image_shares;
  std::vector<StageReport> stages;
};

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
