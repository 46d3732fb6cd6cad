#pragma once
// Recorded motion of a target: CSV with a name per column.

#include <filesystem>
#include <vector>

#include "geometry/motion_sample.h"
#include "io/dicom/notes.h"

namespace isoshift {

// Columns are separated by "," or ";"; with ";" numbers may have decimal commas. The time is the column `t_s`, or
// `Timestamp` in ms. The position in mm is `measured_x_mm`, `x_mm` or `x`, and likewise for y and z. Rows without any
// coordinate are skipped, and so are rows of zeros at the end, which some recorders write. If the time of a single row
// goes back, the row is skipped, with a warning. Throws Error naming file and line.
std::vector<MotionSample> read_motion_trace(const std::filesystem::path& path, Notes& notes);

}  // namespace isoshift
