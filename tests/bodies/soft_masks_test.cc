// Weights of bodies in soft tissue.

#include "bodies/soft_masks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace isoshift::soft_masks_test {
namespace {

// Two cubes of 20 mm, 40 mm apart along x, and a couch, in voxels of 2 mm.
BodyMap two_cubes() {
  BodyMap map;
  Eigen::Affine3d lattice = Eigen::Affine3d::Identity();
  lattice.linear() *= 2.0;
  map.labels = Volume<std::uint8_t>({60, 30, 30}, lattice);
  for (int k = 10; k < 20; ++k)
    for (int j = 10; j < 20; ++j)
      for (int i = 0; i < 10; ++i) {
        map.labels.at(10 + i, j, k) = 1;
        map.labels.at(40 + i, j, k) = 2;
      }
  for (int i = 0; i < 60; ++i) map.labels.at(i, 28, 15) = 3;
  map.bodies.resize(3);
  map.bodies[2].kind = Body::Kind::kCouch;
  return map;
}

int weight_at(const SoftMasks& masks, int body, const Eigen::Vector3i& at) {
  for (const SoftMask& mask : masks.masks) {
    const Eigen::Vector3i inside = at - mask.first;
    if (mask.body == body && (inside.array() >= 0).all() && (inside.array() < mask.weight.size.array()).all())
      return mask.weight.at(inside.x(), inside.y(), inside.z());
  }
  return 0;
}

TEST(SoftMasks, SumToOneEverywhere) {
  const SoftMasks masks = soft_masks(two_cubes(), 2);
  ASSERT_EQ(masks.masks.size(), 2U) << "the couch moves with nothing";
  for (int k = 0; k < masks.size.z(); ++k)
    for (int j = 0; j < masks.size.y(); ++j)
      for (int i = 0; i < masks.size.x(); ++i)
        ASSERT_EQ(weight_at(masks, 0, {i, j, k}) + weight_at(masks, 1, {i, j, k}), 255) << i << " " << j << " " << k;
}

TEST(SoftMasks, AreOneInBoneAndChangeSmoothlyBetweenBones) {
  const SoftMasks masks = soft_masks(two_cubes(), 1, 20.0);
  EXPECT_EQ(weight_at(masks, 0, {15, 15, 15}), 255);
  EXPECT_EQ(weight_at(masks, 1, {45, 15, 15}), 255);
  int before = 255;
  for (int i = 20; i < 40; ++i) {  // soft tissue from one to the other
    const int now = weight_at(masks, 0, {i, 15, 15});
    EXPECT_LE(now, before);
    EXPECT_LE(before - now, 55) << "at column " << i;
    before = now;
  }
  EXPECT_NEAR(weight_at(masks, 0, {29, 15, 15}) + weight_at(masks, 0, {30, 15, 15}), 255, 2) << "half-way between them";
}

TEST(SoftMasks, LieWhereTheLabelsDo) {
  const BodyMap map = two_cubes();
  for (const int block : {1, 2, 3}) {
    const SoftMasks masks = soft_masks(map, block);
    for (const SoftMask& mask : masks.masks) {
      const Eigen::Vector3d by_box = mask.weight.patient_from_voxel * Eigen::Vector3d::Zero();
      const Eigen::Vector3d by_lattice = masks.patient_from_voxel * mask.first.cast<double>();
      EXPECT_LT((by_box - by_lattice).norm(), 1e-9);
    }
    const Eigen::Vector3d corner = masks.patient_from_voxel * Eigen::Vector3d::Constant(-0.5);
    EXPECT_LT((corner - map.labels.patient_from_voxel * Eigen::Vector3d::Constant(-0.5)).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace isoshift::soft_masks_test
