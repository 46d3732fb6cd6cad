#pragma once
// The one rounding of every format that people read.

#include <optional>
#include <string>

#include "io/config/site_file.h"

namespace isoshift {

// To 0.1, or to 1 where two sigma exceeds 1; halves away from zero, with sign, "-0.0" never.
std::string rounded(double value, std::optional<double> two_sigma = std::nullopt);

// The same for an uncertainty: rounded up, so that none is shown smaller than it is, and without sign.
std::string rounded_up(double two_sigma);

// A length in the unit of the site. It is rounded in mm first: 4.25 mm is 4.3 mm or 0.43 cm.
std::string rounded_length(double mm, LengthUnit unit, std::optional<double> two_sigma_mm = std::nullopt);
std::string rounded_up_length(double two_sigma_mm, LengthUnit unit);
const char* name_of(LengthUnit unit);

}  // namespace isoshift
