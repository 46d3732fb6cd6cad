#include "bodies/components.h"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>

namespace isoshift {
namespace {

// Sets that grow together (union-find).
class Groups {
 public:
  explicit Groups(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }
  std::uint32_t of(std::uint32_t n) {
    while (parent_[n] != n) n = parent_[n] = parent_[parent_[n]];
    return n;
  }
  void join(std::uint32_t into, std::uint32_t other) { parent_[other] = into; }

 private:
  std::vector<std::uint32_t> parent_;
};

// Calls work(index of a neighbor) for the neighbors of a voxel by face, edge or corner.
template <class T, class Work>
void for_neighbors(const Volume<T>& volume, std::uint32_t index, Work&& work) {
  const Eigen::Vector3i at = voxel_of(volume.size, index);
  const Eigen::Vector3i low = (at.array() - 1).max(0), high = (at.array() + 1).min(volume.size.array() - 1);
  for (int z = low.z(); z <= high.z(); ++z)
    for (int y = low.y(); y <= high.y(); ++y)
      for (int x = low.x(); x <= high.x(); ++x)
        if (const auto n = static_cast<std::uint32_t>(volume.index(x, y, z)); n != index) work(n);
}

}  // namespace

std::vector<VoxelSet> connected_parts(const Volume<std::uint8_t>& mask, std::size_t least_voxels) {
  std::vector<std::uint8_t> seen(mask.voxels.size(), 0);
  std::vector<VoxelSet> parts;
  for (std::uint32_t start = 0; start < mask.voxels.size(); ++start) {
    if (mask.voxels[start] == 0 || seen[start] != 0) continue;
    VoxelSet part = {start};
    seen[start] = 1;
    for (std::size_t next = 0; next < part.size(); ++next)
      for_neighbors(mask, part[next], [&](std::uint32_t n) {
        if (mask.voxels[n] == 0 || seen[n] != 0) return;
        seen[n] = 1;
        part.push_back(n);
      });
    if (part.size() < least_voxels) continue;
    std::ranges::sort(part);
    parts.push_back(std::move(part));
  }
  std::ranges::stable_sort(parts, std::greater(), &VoxelSet::size);
  return parts;
}

std::vector<VoxelSet> parts_between_necks(const Volume<float>& depth_mm, double neck_mm) {
  constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  constexpr float kNeckShare = 0.7F;
  std::vector<std::uint32_t> deepest_first;
  for (std::uint32_t n = 0; n < depth_mm.voxels.size(); ++n)
    if (depth_mm.voxels[n] > 0.0F) deepest_first.push_back(n);
  std::ranges::stable_sort(deepest_first, std::greater(), [&](std::uint32_t n) { return depth_mm.voxels[n]; });
  std::vector<std::uint32_t> part_of(depth_mm.voxels.size(), kNone);
  std::vector<float> peaks;
  Groups groups(deepest_first.size());
  for (const std::uint32_t voxel : deepest_first) {
    const float depth = depth_mm.voxels[voxel];
    std::uint32_t mine = kNone;
    for_neighbors(depth_mm, voxel, [&](std::uint32_t n) {
      if (part_of[n] == kNone) return;
      std::uint32_t other = groups.of(part_of[n]);
      if (mine == kNone) {
        mine = other;
      } else if (mine != other) {
        if (peaks[other] > peaks[mine]) std::swap(mine, other);  // the deeper part goes on
        const bool is_neck = peaks[other] - depth > static_cast<float>(neck_mm) && depth <= kNeckShare * peaks[other];
        if (!is_neck) groups.join(mine, other);
      }
    });
    if (mine == kNone) {
      mine = static_cast<std::uint32_t>(peaks.size());
      peaks.push_back(depth);
    }
    part_of[voxel] = mine;
  }
  std::map<std::uint32_t, VoxelSet> parts;
  for (std::uint32_t n = 0; n < part_of.size(); ++n)
    if (part_of[n] != kNone) parts[groups.of(part_of[n])].push_back(n);
  std::vector<VoxelSet> result;
  result.reserve(parts.size());
  for (auto& [group, part] : parts) result.push_back(std::move(part));
  std::ranges::stable_sort(result, std::greater(), &VoxelSet::size);
  return result;
}

}  // namespace isoshift
