#pragma once
// The pose at which a registration begins, from a file.

#include <filesystem>
#include <span>

#include "io/study/study.h"
#include "setup/start.h"

namespace isoshift {

// The setup error in a result.json, in a truth.json, or in the file of a pose that a person has set:
//
//   {"setup_error": {"translation_mm": [1, 2, 3], "rotation_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "set_by":
//   "jdoe"}
//
// or a Spatial Registration object of any program that registers the study's CT, or the same matrix in ITK's format.
// `source_isocenter_mm`, three numbers or none: where the machine's isocenter lies in the source frame of such an
// object, if neither it nor the study's X-rays tell. Throws Error naming the file for one that holds no complete setup
// error or no rotation, and for one of another patient, another CT or about another planned pose than the study's. What
// was assumed of an object becomes a warning.
Start read_start(const std::filesystem::path& file, const Study& study, std::span<const double> source_isocenter_mm,
                 Notes& notes);

}  // namespace isoshift
