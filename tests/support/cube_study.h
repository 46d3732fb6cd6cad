#pragma once

#include <functional>

#include "io/study/study.h"

namespace isoshift {

// A study of a CT alone: a cube about the patient's origin, with a voxel in its middle and `voxels`, an odd number,
// along each edge. The patient lies as planned, head first and supine, with `isocenter_mm` at the room's isocenter.
Study cube_study(int voxels, double voxel_mm, const Eigen::Vector3d& isocenter_mm,
                 const std::function<float(const Eigen::Vector3d& patient_mm)>& hu);

}  // namespace isoshift
