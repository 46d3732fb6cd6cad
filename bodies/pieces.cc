#include "bodies/pieces.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"

namespace isoshift {
namespace {

// Centers and which of them each point is nearest to.
struct Clusters {
  std::vector<Eigen::Vector3f> centers;
  std::vector<std::uint32_t> nearest;
  float farthest = 0.0F;  // of a point from its center
  std::size_t farthest_point = 0;
};

void assign(const std::vector<Eigen::Vector3f>& points, Clusters& clusters) {
  std::vector<float> distances(points.size());
  clusters.nearest.resize(points.size());
  parallel_for(std::size_t{0}, points.size(), [&](std::size_t n) {
    float least = 1e30F;
    for (std::uint32_t c = 0; c < clusters.centers.size(); ++c) {
      const float d = (points[n] - clusters.centers[c]).squaredNorm();
      if (d < least) least = d, clusters.nearest[n] = c;
    }
    distances[n] = std::sqrt(least);
  });
  const auto most = std::ranges::max_element(distances);
  clusters.farthest = *most;
  clusters.farthest_point = static_cast<std::size_t>(most - distances.begin());
}

void move_to_means(const std::vector<Eigen::Vector3f>& points, Clusters& clusters) {
  std::vector<Eigen::Vector3d> sums(clusters.centers.size(), Eigen::Vector3d::Zero());
  std::vector<double> counts(clusters.centers.size(), 0.0);
  for (std::size_t n = 0; n < points.size(); ++n) {
    sums[clusters.nearest[n]] += points[n].cast<double>();
    ++counts[clusters.nearest[n]];
  }
  for (std::size_t c = 0; c < sums.size(); ++c)
    if (counts[c] > 0.0) clusters.centers[c] = (sums[c] / counts[c]).cast<float>();
}

}  // namespace

// k-means: a center more, where a point lies farthest from all of them, until all points are near enough.
std::vector<VoxelSet> pieces_of(const VoxelSet& voxels, const Eigen::Vector3i& lattice_size, double edge_mm,
                                double most_mm) {
  std::vector<Eigen::Vector3f> points(voxels.size());
  std::ranges::transform(voxels, points.begin(), [&](std::uint32_t n) -> Eigen::Vector3f {
    return static_cast<float>(edge_mm) * voxel_of(lattice_size, n).cast<float>();
  });
  Clusters clusters;
  clusters.centers = {Eigen::Vector3f::Zero()};
  clusters.nearest.assign(points.size(), 0);
  const auto radius = static_cast<float>(0.5 * most_mm);
  while (clusters.centers.size() <= points.size()) {
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds; ++round) {
      move_to_means(points, clusters);
      assign(points, clusters);
    }
    if (clusters.farthest <= radius) break;
    clusters.centers.push_back(points[clusters.farthest_point]);
    assign(points, clusters);
  }
  std::vector<VoxelSet> pieces(clusters.centers.size());
  for (std::size_t n = 0; n < voxels.size(); ++n) pieces[clusters.nearest[n]].push_back(voxels[n]);
  std::erase_if(pieces, [](const VoxelSet& piece) { return piece.empty(); });
  return pieces;
}

}  // namespace isoshift
