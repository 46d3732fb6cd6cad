#pragma once
// The pose at which a registration begins, from a file.

#include <filesystem>

#include "io/study/study.h"
#include "setup/start.h"

namespace isoshift {

// The setup error in a result.json, in a truth.json, or in the file of a pose that a person has set:
//
//   {"setup_error": {"translation_mm": [1, 2, 3], "rotation_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "set_by":
//   "jdoe"}
//
// Throws Error naming the file for one that holds no complete setup error or no rotation, and for a result of another
// patient or about another isocenter than the study's.
Start read_start(const std::filesystem::path& file, const Study& study);

}  // namespace isoshift
