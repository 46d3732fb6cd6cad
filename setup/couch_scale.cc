#include "setup/couch_scale.h"

#include <algorithm>
#include <cmath>

namespace isoshift {
namespace {

constexpr double kVarianIecTurnMm = 10'000.0;  // 1000 cm: the display starts again at 0
constexpr double kVarianStandardZeroMm = 1000.0;

// In [0, modulus), also where rounding would give the modulus itself.
double wrapped(double value, double modulus) {
  const double rest = value - modulus * std::floor(value / modulus);
  return rest < modulus ? rest : 0.0;
}

}  // namespace

std::string_view to_string(CouchScale scale) {
  switch (scale) {
    case CouchScale::kIec61217: return "IEC 61217";
    case CouchScale::kVarianIec: return "Varian IEC";
    case CouchScale::kVarianStandard: return "Varian Standard";
  }
  return "";
}

std::optional<CouchScale> couch_scale_from(std::string_view name) {
  const auto found = std::ranges::find(kCouchScales, name, [](CouchScale scale) { return to_string(scale); });
  return found == kCouchScales.end() ? std::nullopt : std::optional(*found);
}

CouchReadOut on_scale(CouchScale scale, const CouchReadOut& iec) {
  const Eigen::Vector3d& at = iec.position_mm;
  switch (scale) {
    case CouchScale::kIec61217: return {.position_mm = at, .angle_deg = wrapped(iec.angle_deg, 360.0)};
    case CouchScale::kVarianIec:
      return {.position_mm = {wrapped(at.x(), kVarianIecTurnMm), wrapped(at.y(), kVarianIecTurnMm),
                              wrapped(-at.z(), kVarianIecTurnMm)},
              .angle_deg = wrapped(-iec.angle_deg, 360.0)};
    case CouchScale::kVarianStandard:
      return {.position_mm = {kVarianStandardZeroMm + at.x(), kVarianStandardZeroMm + at.y(),
                              kVarianStandardZeroMm - at.z()},
              .angle_deg = wrapped(180.0 - iec.angle_deg, 360.0)};
  }
  return iec;
}

std::array<int, 4> signs_on_scale(CouchScale scale) {
  if (scale == CouchScale::kIec61217) return {1, 1, 1, 1};
  return {1, 1, -1, -1};
}

}  // namespace isoshift
