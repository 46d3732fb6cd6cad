#include "drr/raycast/bounding_faces.h"

namespace isoshift {

std::vector<BlockFace> bounding_faces(const BlockGrid& blocks) {
  const auto occupied = [&](const Eigen::Vector3i& block) {
    return (block.array() >= 0).all() && (block.array() < blocks.size.array()).all() &&
           blocks.at(block.x(), block.y(), block.z());
  };
  std::vector<BlockFace> faces;
  for (int z = 0; z < blocks.size.z(); ++z)
    for (int y = 0; y < blocks.size.y(); ++y)
      for (int x = 0; x < blocks.size.x(); ++x) {
        if (!blocks.at(x, y, z)) continue;
        for (int side = 0; side < 6; ++side) {
          Eigen::Vector3i neighbor(x, y, z);
          neighbor[side / 2] += side % 2 == 1 ? 1 : -1;
          if (!occupied(neighbor))
            faces.push_back({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y),
                             static_cast<std::uint16_t>(z), static_cast<std::uint16_t>(side)});
        }
      }
  return faces;
}

}  // namespace isoshift
