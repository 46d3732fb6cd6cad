#include "setup/irradiated_field.h"

#include <algorithm>
#include <limits>

namespace isoshift {

const char* to_string(IrradiatedField::Origin origin) {
  switch (origin) {
    case IrradiatedField::Origin::kWholeReceptor: return "whole receptor";
    case IrradiatedField::Origin::kFound: return "found";
    case IrradiatedField::Origin::kDeclared: return "declared";
    case IrradiatedField::Origin::kDrawn: return "drawn";
  }
  return "";
}

double inside_px(const IrradiatedField& field, const Eigen::Vector2d& place_px) {
  double nearest = std::numeric_limits<double>::infinity();
  bool is_inside = false;  // an odd number of sides is crossed on the way to the right
  for (std::size_t n = 0; n < field.corners_px.size(); ++n) {
    const Eigen::Vector2d &from = field.corners_px[n], &to = field.corners_px[(n + 1) % field.corners_px.size()];
    const Eigen::Vector2d side = to - from, off = place_px - from;
    const double along = std::clamp(off.dot(side) / std::max(side.squaredNorm(), 1e-12), 0.0, 1.0);
    nearest = std::min(nearest, (off - along * side).norm());
    if ((from.y() > place_px.y()) != (to.y() > place_px.y()) && off.x() < side.x() * off.y() / side.y())
      is_inside = !is_inside;
  }
  return is_inside ? nearest : -nearest;
}

}  // namespace isoshift
