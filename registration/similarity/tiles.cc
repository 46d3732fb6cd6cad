#include "registration/similarity/tiles.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "registration/preprocess/preprocess.h"

namespace isoshift {

std::vector<Tile> tiles_of(const XrayView& view, std::span<const std::uint32_t> compared, double edge_mm) {
  const int edge = std::max(1, static_cast<int>(std::lround(edge_mm * pixels_per_mm(view))));
  std::map<std::pair<int, int>, std::vector<std::uint32_t>> by_place;
  for (std::uint32_t n = 0; n < compared.size(); ++n) {
    const int row = static_cast<int>(compared[n]) / view.columns, column = static_cast<int>(compared[n]) % view.columns;
    by_place[{row / edge, column / edge}].push_back(n);
  }
  std::vector<Tile> tiles;
  tiles.reserve(by_place.size());
  for (auto& [place, numbers] : by_place) {
    const double covered = static_cast<double>(numbers.size()) / (edge * edge);
    tiles.push_back({.compared = std::move(numbers), .covered = covered});
  }
  return tiles;
}

}  // namespace isoshift
