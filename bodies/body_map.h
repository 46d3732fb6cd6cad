#pragma once
// The rigid bodies that a CT shows: vertebrae, ribs, pieces of other bones, the couch. Found without a person and
// without training data; docs/algorithms.md, "Bodies".

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/volume.h"

namespace isoshift {

struct Body {
  enum class Kind { kBone, kVertebra, kRib, kCouch };
  Kind kind = Kind::kBone;
  std::string name;                                             // empty if it is not sure
  Eigen::Vector3d center_patient_mm = Eigen::Vector3d::Zero();  // of a vertebra its body's, else the mean of its voxels
  double volume_mm3 = 0.0;
  Eigen::AlignedBox3d box_patient_mm;  // of its voxels
  bool is_cut = false;                 // a vertebra that the CT shows in part
};
std::string_view to_string(Body::Kind kind);

// Two bodies that touch, or nearly so: indices into BodyMap::bodies, a < b.
struct Joint {
  int a = -1, b = -1;
  Eigen::Vector3d at_patient_mm = Eigen::Vector3d::Zero();
  bool is_stiff = false;  // pieces of one bone
};

struct BodyMap {
  // On cubes along the patient's axes. 0: air and soft tissue; n: bodies[n - 1].
  Volume<std::uint8_t> labels;
  std::vector<Body> bodies;  // vertebrae first, from the feet to the head; the couch last
  std::vector<Joint> joints;
};

// A bone that a person has drawn, such as a vertebra or the jaw: 1 inside. It replaces the body that was found there,
// and what it covers is taken from the others.
struct DrawnBone {
  std::string name;
  Volume<std::uint8_t> mask;
};

struct BodyOptions {
  double lattice_mm = 2.0;      // edge of the labels' voxels; larger for very large CTs
  double bone_hu = 200.0;       // of bone, averaged over such a voxel
  double most_piece_mm = 80.0;  // diameter of the pieces that larger bones are divided into
};

// The same CT gives the same bodies. Takes about a second on two cores for 512 x 512 x 140 voxels: nothing is kept on
// disk, callers keep the map with the CT.
BodyMap find_bodies(const Volume<float>& ct_hu, std::span<const DrawnBone> drawn = {}, const BodyOptions& options = {});

}  // namespace isoshift
