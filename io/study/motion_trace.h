#pragma once
// Recorded motion of a target: CSV with a name per column.

#include <filesystem>
#include <vector>

#include "geometry/motion_sample.h"
#include "io/dicom/notes.h"

namespace isoshift {

// Columns separated by ; or , with decimal commas where ; separates. The time is `t_s`, or `Timestamp` in ms; the
// position `measured_x_mm`, `x_mm` or `x`, and y and z alike, in mm. Rows without a position are left out, and so are
// rows of zeros at the end, which some recorders write. Single rows whose time goes back are left out with a warning.
// Throws Error naming file and line.
std::vector<MotionSample> read_motion_trace(const std::filesystem::path& path, Notes& notes);

}  // namespace isoshift
