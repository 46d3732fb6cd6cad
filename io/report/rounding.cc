#include "io/report/rounding.h"

#include <fmt/format.h>

#include <cmath>

namespace isoshift {
namespace {

// 1 or 10 steps per mm or degree.
int steps_per_unit(double two_sigma) { return two_sigma > 1.0 ? 1 : 10; }

// Steps times 10^-decimals. Exact: no second rounding.
std::string written(double steps, int decimals, bool with_sign) {
  if (steps == 0.0) return fmt::format("{:.{}f}", 0.0, decimals);
  const double value = steps * std::pow(10.0, -decimals);
  return with_sign ? fmt::format("{:+.{}f}", value, decimals) : fmt::format("{:.{}f}", value, decimals);
}

std::string in_steps(double value, double two_sigma, int more_decimals, bool up) {
  const int per_unit = steps_per_unit(two_sigma);
  const double steps = up ? std::ceil(value * per_unit - 1e-9) : std::round(value * per_unit);
  return written(steps, (per_unit == 10 ? 1 : 0) + more_decimals, !up);
}

}  // namespace

std::string rounded(double value, std::optional<double> two_sigma) {
  return in_steps(value, two_sigma.value_or(0.0), 0, false);
}

std::string rounded_up(double two_sigma) { return in_steps(two_sigma, two_sigma, 0, true); }

std::string rounded_length(double mm, LengthUnit unit, std::optional<double> two_sigma_mm) {
  return in_steps(mm, two_sigma_mm.value_or(0.0), unit == LengthUnit::kCm ? 1 : 0, false);
}

std::string unsigned_length(double mm, LengthUnit unit, std::optional<double> two_sigma_mm) {
  std::string text = rounded_length(mm, unit, two_sigma_mm);
  return text.starts_with('+') ? text.substr(1) : text;
}

std::string rounded_up_length(double two_sigma_mm, LengthUnit unit) {
  return in_steps(two_sigma_mm, two_sigma_mm, unit == LengthUnit::kCm ? 1 : 0, true);
}

const char* name_of(LengthUnit unit) { return unit == LengthUnit::kCm ? "cm" : "mm"; }

bool is_zero(const std::string& rounded) { return rounded.find_first_of("123456789") == std::string::npos; }

}  // namespace isoshift
