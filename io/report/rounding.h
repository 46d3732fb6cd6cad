#pragma once
// The rounding of numbers in all formats that people read.

#include <optional>
#include <string>

#include "io/config/site_file.h"

namespace isoshift {

// Rounds to 0.1, or to 1 if two sigma exceeds 1; halves away from zero. With a sign, but never "-0.0".
std::string rounded(double value, std::optional<double> two_sigma = std::nullopt);

// Rounds an uncertainty up, so that it is never shown smaller than it is. Without a sign.
std::string rounded_up(double two_sigma);

// A length in the unit of the site. The length is rounded in mm first: 4.25 mm is 4.3 mm or 0.43 cm.
std::string rounded_length(double mm, LengthUnit unit, std::optional<double> two_sigma_mm = std::nullopt);
std::string unsigned_length(double mm, LengthUnit unit, std::optional<double> two_sigma_mm = std::nullopt);
std::string rounded_up_length(double two_sigma_mm, LengthUnit unit);
const char* name_of(LengthUnit unit);

// Whether a rounded number is 0: it then has no direction.
bool is_zero(const std::string& rounded);

}  // namespace isoshift
