#include "drr/occupied_blocks.h"

#include <algorithm>

#include "base/parallel.h"

namespace isoshift {
namespace {

// The voxels of one block along one axis: [begin, end), cut to the volume. `before` more voxels count at its low end.
struct BlockRule {
  int edge, before;
};
struct Range {
  int begin, end;
};
Range range_of(int block, int axis, const BlockRule& rule, const Eigen::Vector3i& size) {
  const int first = block * rule.edge;
  return {std::max(0, first - rule.before), std::min(size[axis], first + rule.edge)};
}

template <class T>
void mark(const std::vector<T>& voxels, const Eigen::Vector3i& size, const BlockRule& rule, BlockGrid& grid) {
  parallel_for(0, grid.size.z(), [&](int z) {
    const Range slices = range_of(z, 2, rule, size);
    for (int y = 0; y < grid.size.y(); ++y) {
      const Range rows = range_of(y, 1, rule, size);
      std::uint8_t* blocks = &grid.occupied[(static_cast<std::size_t>(z) * grid.size.y() + y) * grid.size.x()];
      for (int k = slices.begin; k < slices.end; ++k)
        for (int j = rows.begin; j < rows.end; ++j) {
          const T* row = voxels.data() + (static_cast<std::size_t>(k) * size.y() + j) * size.x();
          for (int x = 0; x < grid.size.x(); ++x) {
            if (blocks[x] != 0) continue;
            const Range columns = range_of(x, 0, rule, size);
            for (int i = columns.begin; i < columns.end; ++i)
              if (row[i] != T{}) {
                blocks[x] = 1;
                break;
              }
          }
        }
    }
  });
}

BlockGrid marked(const QuantizedVolume& volume, const BlockRule& rule, const Eigen::Vector3i& blocks) {
  BlockGrid grid{.size = blocks, .occupied = {}};
  grid.occupied.resize(blocks.cast<std::size_t>().prod());
  std::visit([&](const auto& voxels) { mark(voxels, volume.size, rule, grid); }, volume.voxels);
  return grid;
}

}  // namespace

BlockGrid occupied_blocks(const QuantizedVolume& volume, int edge) {
  return marked(volume, {.edge = edge, .before = 0}, (volume.size.array() + edge - 1) / edge);
}

BlockGrid interpolation_blocks(const QuantizedVolume& volume, int edge) {
  // One position more than there are voxels, rounded up.
  return marked(volume, {.edge = edge, .before = 1}, (volume.size.array() + edge) / edge);
}

}  // namespace isoshift
