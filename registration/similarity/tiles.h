#pragma once
// Places of a view that are compared each for itself.

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/xray_view.h"

namespace isoshift {

struct Tile {
  std::vector<std::uint32_t> compared;  // which of the compared pixels lie in it
  double covered = 1.0;                 // share of its pixels that are compared
};

// Squares with this edge at the isocenter, row after row; those without a compared pixel (row * columns + column) are
// left out.
std::vector<Tile> tiles_of(const XrayView& view, std::span<const std::uint32_t> compared, double edge_mm);

}  // namespace isoshift
