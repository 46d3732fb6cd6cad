#pragma once
// The phantoms as rigid bodies and soft tissue, so that a bent patient can be made of the same shapes.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "phantom/shapes.h"

namespace isoshift {

// Bone that moves as one piece.
struct PhantomBody {
  std::string name;
  Eigen::Vector3d center_patient_mm;
  Eigen::Vector3d carried_at_patient_mm;  // where it hangs on the rest: a vertebra's center, a joint, a rib's back end
  bool is_vertebra = false;
};

struct PhantomParts {
  // Skin and fat that can become thinner.
  struct Outline {
    std::size_t shape;
    double most_mm;  // that can be lost on every side without baring bone
  };

  std::vector<Shape> shapes;
  std::vector<PhantomBody> bodies;  // Shape::body says which of them a shape belongs to
  std::vector<Outline> outlines;

  // Centers of the vertebral bodies.
  std::vector<Eigen::Vector3d> vertebrae() const;
};

// The phantoms of shapes.h: the same shapes in the same order.
PhantomParts head_parts(const Eigen::Vector3d& center_patient_mm, std::uint64_t seed);
PhantomParts spine_parts(const Eigen::Vector3d& center_patient_mm, std::uint64_t seed);
PhantomParts thorax_parts(const Eigen::Vector3d& target_patient_mm, std::uint64_t seed,
                          const Eigen::Vector3d& displacement_mm);

// Steel balls of 6 mm in a block of acrylic, for the geometry of imagers.
PhantomParts ball_parts(const Eigen::Vector3d& center_patient_mm, std::uint64_t seed);

// Clavicles, scapulae and the heads of the arms, which the usual thorax has not.
void add_shoulders(PhantomParts& thorax, const Eigen::Vector3d& target_patient_mm, std::uint64_t seed);

}  // namespace isoshift
