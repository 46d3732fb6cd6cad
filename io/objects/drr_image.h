#pragma once
// DRRs as DICOM RT Images (PS3.3 A.17; image type DRR): the X-rays that should have been taken.

#include <filesystem>

#include "geometry/image.h"
#include "io/study/study.h"

namespace isoshift {

// The DRR of the study's view `index`, with the patient lying off plan by `setup_error` (room). It has the view's
// geometry, refers to plan and CT, and lies in the CT's frame of reference only where the patient lies as planned.
// Stored values are line integrals in thousandths (LOG, sign -1). Throws Error for a view that an RT Image cannot
// describe, and if the file exists.
void write_drr_image(const Study& study, std::size_t index, const Image<float>& line_integral,
                     const Eigen::Isometry3d& setup_error, const std::string& series_instance_uid,
                     const std::filesystem::path& path);

}  // namespace isoshift
