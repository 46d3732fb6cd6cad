#pragma once
// What no scanner writes into a CT: numbers that are none of a patient, but of a file that was damaged.

#include <string>
#include <vector>

#include "geometry/volume.h"

namespace isoshift {

// In words; empty where there is nothing to doubt. `hu`: rows and slices of the CT as stored.
std::vector<std::string> ct_doubts(const Volume<float>& hu);

}  // namespace isoshift
