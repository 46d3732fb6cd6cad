#pragma once
// The patient as rigid bodies that springs hold together (docs/algorithms.md, "Bodies that bend").

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "drr/bodies.h"

namespace isoshift {

struct JointedBodies {
  struct Body {
    std::string name;
    bool is_vertebra = false;  // those of a spine follow each other, from the feet to the head
    int vertebra = 0;          // counted from the one nearest to the target, positive toward the head
    bool breathes = false;     // may lie elsewhere in every view: it has a pose per view
    bool is_soft = false;      // far from bone: a search holds it to its neighbors until the bones are about right
  };
  // Two bodies should neither move apart at a joint nor turn against each other: by one sigma more seldom than not.
  struct Spring {
    std::size_t a = 0, b = 0;
    Eigen::Vector3d at_patient_mm = Eigen::Vector3d::Zero();
    double sigma_mm = 1.0, sigma_rad = 0.02;
  };

  std::vector<Body> bodies;
  std::vector<BodyShare> shares;  // of the same bodies
  std::vector<Spring> springs;
};

// The pose of every body in every view: [body][view], room from patient. Bodies that do not breathe have one pose.
using BodyPoses = std::vector<std::vector<Eigen::Isometry3d>>;

}  // namespace isoshift
