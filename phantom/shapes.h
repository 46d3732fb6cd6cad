#pragma once
// Analytic bodies in patient coordinates: a phantom is a list of them, each adding its material to whatever it
// overlaps.

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "geometry/volume.h"

namespace isoshift {

// Amounts of the two materials that make up everything here, 1 being pure water or pure cortical bone (1.92 g/cm3).
// A shape may take away what another one brought: water -1, bone +1 turns water into bone.
struct Material {
  double water = 0.0;
  double bone = 0.0;
};

struct Shape {
  enum class Kind {
    kEllipsoid,
    kCylinder,
    kBox
  };  // the unit sphere; the unit circle times [-1, 1]; the cube [-1, 1]^3

  Kind kind = Kind::kEllipsoid;
  Eigen::Affine3d unit_from_patient = Eigen::Affine3d::Identity();
  Material added;
  int body = -1;  // of PhantomParts::bodies; -1: soft tissue

  // Length of the part of the segment from `begin` to `end` inside the shape, in mm.
  double chord_mm(const Eigen::Vector3d& begin_patient_mm, const Eigen::Vector3d& end_patient_mm) const;
  bool contains(const Eigen::Vector3d& point_patient_mm) const;
};

// A shape with the given half extents about a center, its axes turned by `rotation`.
Shape make_shape(Shape::Kind kind, const Eigen::Vector3d& center_patient_mm, const Eigen::Vector3d& half_extent_mm,
                 const Material& added, const Eigen::Matrix3d& rotation = Eigen::Matrix3d::Identity());

// The CT of the shapes: HU averaged over each voxel by 2 x 2 x 2 points, as a scanner at 120 kVp sees them.
Volume<float> ct_of_shapes(const std::vector<Shape>& shapes, const Eigen::Vector3i& size,
                           const Eigen::Affine3d& patient_from_voxel);

// Sections of a body about a point, with bone texture drawn from `seed`: a head, or a lumbar spine.
std::vector<Shape> head_phantom(const Eigen::Vector3d& center_patient_mm, std::uint64_t seed);
std::vector<Shape> spine_phantom(const Eigen::Vector3d& center_patient_mm, std::uint64_t seed);

// A thorax about a target in the right lung, which breathing has displaced; diaphragm and ribs move with it.
inline constexpr double kTargetRadiusMm = 13.0;
std::vector<Shape> thorax_phantom(const Eigen::Vector3d& target_patient_mm, std::uint64_t seed,
                                  const Eigen::Vector3d& displacement_mm);

// Centers of the vertebral bodies in these phantoms, patient coordinates.
std::vector<Eigen::Vector3d> head_vertebrae(const Eigen::Vector3d& center_patient_mm, std::uint64_t seed);
std::vector<Eigen::Vector3d> spine_vertebrae(const Eigen::Vector3d& center_patient_mm, std::uint64_t seed);
std::vector<Eigen::Vector3d> thorax_vertebrae(const Eigen::Vector3d& target_patient_mm, std::uint64_t seed);

}  // namespace isoshift
