#pragma once
// A drawn structure as voxels (docs/dicom.md, SS-1).

#include <cstdint>

#include "geometry/volume.h"
#include "io/dicom/rt_structures.h"

namespace isoshift {

// 1 in the voxels whose center lies in the structure, 0 elsewhere. All contours of one plane count by even-odd, so that
// a contour within another is a hole. A plane stands for the slab that reaches half-way to the planes beside it; beyond
// the first and the last one by half its ContourSlabThickness, else half the smallest distance of planes, else half the
// distance of slices. Throws Error for a contour not parallel to the slices, and where no voxel lies in the structure.
Volume<std::uint8_t> mask_of(const Structure& structure, const Eigen::Vector3i& size,
                             const Eigen::Affine3d& patient_from_voxel);

}  // namespace isoshift
