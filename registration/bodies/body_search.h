#pragma once
// Finds where every body of a patient lies, from a pose of the whole patient that is about right.

#include <memory>
#include <span>
#include <vector>

#include "registration/bodies/jointed_bodies.h"
#include "registration/objective.h"
#include "registration/search.h"

namespace isoshift {

// From coarse to fine; every stage begins where the last one ended.
struct BodyStage {
  double pixel_mm = 2.0;  // the stage's pixels, at the isocenter
  bool has_coarse_voxels = false;
  double pixel_fraction = 0.8;  // share of the field's pixels compared: those with the strongest gradients
  int min_pixels = 4000;        // of every view, if the field has them
  double tile_mm = 12.0;        // edge of the tiles, at the isocenter
  // Of the springs of soft tissue: it is held at first, or it would settle where the patient as a whole was found, and
  // keep the bones there.
  double soft_sigmas = 1.0;
  double initial_step_mm = 2.0;  // of the parameters of all bodies together: first trust-region radius
  double least_gain = 0.5;       // of the logarithm of probability: the stage ends when no step promises more
  int max_evaluations = 25;
};

struct BodySearchOptions {
  std::vector<BodyStage> stages = {{.pixel_mm = 4.0,
                                    .has_coarse_voxels = true,
                                    .pixel_fraction = 0.6,
                                    .min_pixels = 2000,
                                    .tile_mm = 25.0,
                                    .soft_sigmas = 0.1,
                                    .initial_step_mm = 4.0},
                                   {.pixel_mm = 2.0, .least_gain = 1.0, .max_evaluations = 15},
                                   {.pixel_mm = 1.3, .tile_mm = 7.0, .initial_step_mm = 1.0, .least_gain = 2.0}};
  double bound_mm = 40.0;  // of every parameter and stage
};

struct BodySearchResult {
  BodyPoses poses;
  double log_probability = 0.0;  // of the last stage: of poses found with the same stage the largest is the best
  std::vector<StageReport> stages;
};

// What is known about poses. Of the motions of all bodies, in the first view for those that breathe: in the room, about
// the isocenter, in the units of MotionDerivatives, six after six.
struct BodyCertainty {
  Eigen::MatrixXd covariance;
  // The same if the sigmas of all springs were twice as large: what the images show does not change by that.
  Eigen::MatrixXd covariance_on_loose_springs;
  Eigen::VectorXd motions_left;  // how far the model would still go
};

// What share of what is known about a place comes from the images, in the direction that is known least from them; the
// rest comes from springs. Covariances of the place, in mm.
double image_share(const Eigen::Matrix3d& covariance, const Eigen::Matrix3d& on_loose_springs);

// The bodies of a CT, rendered apart and as one.
struct RenderedBodies {
  BodyRenderers apart;
  std::unique_ptr<Renderer> as_one;

  // Line integrals of the pixels that `pixels` renders in a view, with bodies at some poses.
  std::vector<float> line_integrals(const Objective& pixels, const BodyPoses& poses, std::size_t view) const;

  // Gradient correlation per view, of all pixels in the fields, with bodies at some poses.
  std::vector<double> matches(std::span<const FixedImage> images, const BodyPoses& poses) const;
};

// A patient whose bodies can be rendered: what searches share.
struct BodyScene {
  const JointedBodies& bodies;
  const RenderedBodies &fine, &coarse;  // by the voxels of their CT
  const FixedViews& views;
  Eigen::Isometry3d whole_room_from_patient;  // where the pixels are chosen that are compared

  const RenderedBodies& of(const BodyStage& stage) const { return stage.has_coarse_voxels ? coarse : fine; }
};

// All bodies in all views at one pose.
BodyPoses at_one_pose(const BodyScene& scene, const Eigen::Isometry3d& room_from_patient);

// From poses that are about right, through some stages. Throws Error where a view has too few pixels to compare.
BodySearchResult search_bodies(const BodyScene& scene, const BodyPoses& start, std::span<const BodyStage> stages,
                               double bound_mm);

// Of poses that a search with this stage has found.
BodyCertainty certainty_of(const BodyScene& scene, const BodyPoses& poses, const BodyStage& stage);

}  // namespace isoshift
