#pragma once
// Whether a setup error in a file is about the setup of a study.

#include <nlohmann/json.hpp>
#include <string>

#include "io/study/study.h"

namespace isoshift {

// Throws Error naming `name` where a result.json, a truth.json or a pose set by hand says that it is of another
// patient, patient position, isocenter or table angle than the study. A file need not say any of these.
void require_same_setup(const nlohmann::json& file, const std::string& name, const Study& study);

}  // namespace isoshift
