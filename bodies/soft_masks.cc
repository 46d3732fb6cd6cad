#include "bodies/soft_masks.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "bodies/distance.h"
#include "geometry/voxel_box.h"

namespace isoshift {
namespace {

// Labels of blocks of voxels: the label that most of a block's bone has, if a quarter of the block is bone.
Volume<std::uint8_t> in_label_blocks(const Volume<std::uint8_t>& labels, int block, int couch) {
  const Eigen::Affine3d fine_from_coarse = voxel_from_block(Eigen::Vector3i::Constant(block));
  const Eigen::Vector3i size = (labels.size.array() + block - 1) / block;
  Volume<std::uint8_t> coarse(size, labels.patient_from_voxel * fine_from_coarse);
  parallel_for(0, size.z(), [&](int k) {
    std::vector<int> counts(256, 0);
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        std::ranges::fill(counts, 0);
        int bone = 0;
        for (int n = 0; n < block * block * block; ++n) {
          const Eigen::Vector3i at(i * block + n % block, j * block + n / block % block, k * block + n / block / block);
          if ((at.array() >= labels.size.array()).any()) continue;
          const int label = labels.at(at.x(), at.y(), at.z());
          if (label == 0 || label == couch) continue;
          ++counts[label];
          ++bone;
        }
        if (4 * bone >= block * block * block)
          coarse.at(i, j, k) = static_cast<std::uint8_t>(std::ranges::max_element(counts) - counts.begin());
      }
  });
  return coarse;
}

Volume<std::uint8_t> where(const Volume<std::uint8_t>& labels, int label) {
  Volume<std::uint8_t> mask(labels.size, labels.patient_from_voxel);
  std::ranges::transform(labels.voxels, mask.voxels.begin(),
                         [&](std::uint8_t value) { return value != 0 && (label == 0 || value == label) ? 1 : 0; });
  return mask;
}

// The parts of 255 that bodies get: rounded down, what is left to the largest.
void share_out(std::vector<double>& weights, std::vector<std::uint8_t>& parts) {
  double sum = 0.0;
  for (const double weight : weights) sum += weight;
  int left = 255;
  for (std::size_t n = 0; n < weights.size(); ++n) {
    parts[n] = static_cast<std::uint8_t>(255.0 * weights[n] / sum);
    left -= parts[n];
  }
  parts[static_cast<std::size_t>(std::ranges::max_element(weights) - weights.begin())] +=
      static_cast<std::uint8_t>(left);
}

// The smallest box that holds what is not 0.
SoftMask cropped(const Volume<std::uint8_t>& weight, int body) {
  SoftMask mask{.body = body, .weight = {}};
  const VoxelBox box = occupied_voxels(weight.voxels.data(), weight.size);
  if (box.is_empty()) return mask;
  mask.first = box.first;
  const Eigen::Vector3i size = box.size();
  mask.weight = Volume<std::uint8_t>(size, weight.patient_from_voxel * Eigen::Translation3d(mask.first.cast<double>()));
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i)
        mask.weight.at(i, j, k) = weight.at(i + mask.first.x(), j + mask.first.y(), k + mask.first.z());
  return mask;
}

}  // namespace

SoftMasks soft_masks(const BodyMap& map, int block, double transition_mm) {
  int couch = 0;
  for (std::size_t n = 0; n < map.bodies.size(); ++n)
    if (map.bodies[n].kind == Body::Kind::kCouch) couch = static_cast<int>(n) + 1;
  const Volume<std::uint8_t> labels = in_label_blocks(map.labels, block, couch);
  SoftMasks result{.size = labels.size, .patient_from_voxel = labels.patient_from_voxel, .masks = {}, .to_bone_mm = {}};
  result.to_bone_mm = Volume<float>(labels.size, labels.patient_from_voxel);
  std::vector<std::uint8_t> is_there(256, 0);
  for (const std::uint8_t label : labels.voxels) is_there[label] = 1;
  std::vector<int> present;
  for (int label = 1; label < 256; ++label)
    if (is_there[label] != 0) present.push_back(label);
  if (present.empty()) return result;

  std::vector<Volume<float>> distances;
  distances.reserve(present.size());
  for (const int label : present) distances.push_back(distance_mm(where(labels, label)));
  std::vector<Volume<std::uint8_t>> weights(present.size(),
                                            Volume<std::uint8_t>(labels.size, labels.patient_from_voxel));
  parallel_for(0, labels.size.z(), [&](int k) {
    std::vector<double> of_body(present.size());
    std::vector<std::uint8_t> parts(present.size());
    for (std::size_t n = labels.index(0, 0, k); n < labels.index(0, 0, k + 1); ++n) {
      double least = 1e30;
      for (const Volume<float>& distance : distances) least = std::min<double>(least, distance.voxels[n]);
      result.to_bone_mm.voxels[n] = static_cast<float>(least);
      for (std::size_t b = 0; b < present.size(); ++b) {
        const double d = distances[b].voxels[n], within = std::max(0.0, least + transition_mm - d);
        // Within the body itself nothing else counts.
        of_body[b] = least <= 0.0 ? (d <= 0.0 ? 1.0 : 0.0) : within * within / (d * d);
      }
      share_out(of_body, parts);
      for (std::size_t b = 0; b < present.size(); ++b) weights[b].voxels[n] = parts[b];
    }
  });
  for (std::size_t b = 0; b < present.size(); ++b) result.masks.push_back(cropped(weights[b], present[b] - 1));
  return result;
}

}  // namespace isoshift
