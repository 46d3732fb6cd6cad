#pragma once
// Where the spine runs: a line through the middle of the vertebral bodies.

#include <Eigen/Core>
#include <vector>

#include "geometry/volume.h"

namespace isoshift {

// What vertebrae are told by in a slice.
enum class SpineSigns {
  kBodyCanalArch,  // a body of bone, behind it the canal, behind that the arch and a spinous process
  kBodyAlone,      // a compact body of bone with little bone around it: where no arch is to be seen
};

// From the feet to the head, 4 mm apart in z; empty if there is no spine. The lattice lies on the patient's axes
// (on_patient_axes()). The line is within about 8 mm of the middle of the vertebral bodies.
std::vector<Eigen::Vector3d> find_spine_line(const Volume<float>& hu_on_patient_axes, SpineSigns signs);

}  // namespace isoshift
