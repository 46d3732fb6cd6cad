#pragma once
// A patient of several groups of analytic shapes that moved apart. The X-rays are products of the groups' own, each
// group at its own placement: no body, no share and no renderer of the program takes part in them.

#include <vector>

#include "registration/bodies/body_search.h"
#include "tests/support/registration_scene.h"

namespace isoshift {

struct BentScene {
  std::vector<FixedImage> images;  // gantry 0 and 90
  Volume<float> ct;                // of all groups as planned
  Eigen::Isometry3d planned = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Isometry3d> truth;  // of each group: its setup error
  JointedBodies bodies;                  // a body per group, from the lowest to the highest; a spring between neighbors

  FixedViews views() const { return {.images = images, .region = everything}; }

  ProjectedRegion everything;
};

struct MovedGroup {
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation_deg = Eigen::Vector3d::Zero();
};

// A column of vertebra-like groups, 36 mm apart along the patient, the middle one at the isocenter; the shares change
// linearly over 12 mm between two of them.
BentScene bent_column(const std::vector<MovedGroup>& groups);

// The scene's CT as bodies.
RenderedBodies rendered_bodies(const BentScene& scene, const JointedBodies& bodies);

// The scene as searches take it, and what that borrows: all voxels are fine.
class SearchableScene {
 public:
  SearchableScene(const BentScene& scene, const JointedBodies& bodies,
                  const Eigen::Isometry3d& whole_room_from_patient);
  SearchableScene(const SearchableScene&) = delete;
  SearchableScene& operator=(const SearchableScene&) = delete;

  const BodyScene& get() const { return scene_; }

 private:
  RenderedBodies rendered_;
  FixedViews views_;
  BodyScene scene_;
};

// Shares of slabs along the patient's z that add up to 255: from one to the next over `soft_mm` about each limit.
std::vector<BodyShare> slabs(const Volume<float>& ct, const std::vector<double>& limits_mm, double soft_mm);

}  // namespace isoshift
