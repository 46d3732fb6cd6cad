#pragma once
// A drawn structure as voxels (docs/dicom.md, SS-1).

#include <cstdint>

#include "geometry/volume.h"
#include "io/dicom/rt_structures.h"

namespace isoshift {

// 1 in the voxels whose center lies in the structure, 0 elsewhere. All contours of one plane count by even-odd, so that
// a contour within another is a hole. Each plane stands for a slab that reaches half-way to the neighboring planes. On
// its outer side, the slab of the first and of the last plane reaches as far as half its ContourSlabThickness, else
// half the smallest distance of planes, else half the distance of slices. Throws Error for a contour not parallel to
// the slices, and if no voxel lies in the structure.
Volume<std::uint8_t> mask_of(const Structure& structure, const Eigen::Vector3i& size,
                             const Eigen::Affine3d& patient_from_voxel);

}  // namespace isoshift
