#pragma once
// What the files of a study say against each other or themselves, and what decides nothing: a person should know.

#include <string>
#include <vector>

#include "io/study/study.h"

namespace isoshift {

// In words, of the patient's sex, of dates (a CT or a plan that is younger than the X-rays), of machines (X-rays of
// one that no planned beam is for), and of X-rays and structures that somebody has rejected.
std::vector<std::string> contradictions_in(const Study& study);

}  // namespace isoshift
