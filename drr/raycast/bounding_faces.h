#pragma once
// The surface of a bounding structure as squares: the cuberille of the founding paper, and the volume's box as its
// simplest case.

#include <array>
#include <cstdint>
#include <vector>

#include "drr/occupied_blocks.h"

namespace isoshift {

// Block (x, y, z), and where the square looks: 0 -x, 1 +x, 2 -y, 3 +y, 4 -z, 5 +z.
using BlockFace = std::array<std::uint16_t, 4>;

// A square between every occupied block and every empty neighbor (Spoerk et al. 2012, 2.2).
std::vector<BlockFace> bounding_faces(const BlockGrid& blocks);

}  // namespace isoshift
