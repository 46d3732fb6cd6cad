#pragma once
// What the files of a study say differently, and what decides nothing: a person should know.

#include <string>
#include <vector>

#include "io/study/study.h"

namespace isoshift {

// In words, of the patient's sex, of dates (a CT or a plan that is younger than the X-rays), and of machines (X-rays of
// one that no planned beam is for).
std::vector<std::string> contradictions_in(const Study& study);

}  // namespace isoshift
