#pragma once
// Finds where every body of a patient lies, from a pose of the whole patient that is about right.

#include <span>
#include <vector>

#include "drr/attenuation.h"
#include "registration/bodies/jointed_bodies.h"
#include "registration/search.h"

namespace isoshift {

// From coarse to fine; every stage begins where the last one ended.
struct BodyStage {
  double pixel_mm = 2.0;        // the stage's pixels, at the isocenter
  double pixel_fraction = 0.4;  // share of the field's pixels compared: those with the strongest gradients
  int min_pixels = 4000;        // of every view, if the field has them
  double initial_step_mm = 0.7;
  int climbs = 2;            // each after the tiles have been weighed by what the last one left unexplained
  int max_evaluations = 20;  // per climb
};

struct BodySearchOptions {
  std::vector<BodyStage> stages = {
      {.pixel_mm = 4.0, .pixel_fraction = 0.6, .min_pixels = 2000, .initial_step_mm = 1.5, .max_evaluations = 25},
      {.pixel_mm = 2.0}};
  double voxel_mm = 2.0;   // the CT is reduced to voxels up to this edge
  double bound_mm = 40.0;  // of every parameter and stage
};

// What was found of one body. Motions are in the room, about the isocenter, in the units of MotionDerivatives.
struct FoundBody {
  Eigen::Isometry3d room_from_patient = Eigen::Isometry3d::Identity();  // in the first view, if it breathes
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double image_share = 0.0;  // of what is known about its pose in the least certain direction; the rest are springs
};

struct BodySearchResult {
  std::vector<FoundBody> bodies;
  BodyPoses poses;
  int evaluations = 0;
  double seconds = 0.0;
};

// `ct_hu` is the CT that the shares divide. Throws Error where a view has too few pixels to compare.
BodySearchResult search_bodies(const JointedBodies& bodies, const Volume<float>& ct_hu, const AttenuationModel& model,
                               const FixedViews& views, const Eigen::Isometry3d& whole_room_from_patient,
                               const BodySearchOptions& options = {});

}  // namespace isoshift
