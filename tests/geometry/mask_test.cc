#include "geometry/mask.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "base/error.h"

namespace isoshift::mask_test {
namespace {

// Every pair of voxels: slow, and as plain as the definition.
Volume<std::uint8_t> dilated_by_definition(const Volume<std::uint8_t>& mask, double margin_mm) {
  Volume<std::uint8_t> result(mask.size, mask.patient_from_voxel);
  const auto for_all = [&](auto&& use) {
    for (int k = 0; k < mask.size.z(); ++k)
      for (int j = 0; j < mask.size.y(); ++j)
        for (int i = 0; i < mask.size.x(); ++i) use(Eigen::Vector3i(i, j, k));
  };
  for_all([&](const Eigen::Vector3i& to) {
    for_all([&](const Eigen::Vector3i& from) {
      const Eigen::Vector3d apart_mm = mask.patient_from_voxel.linear() * (to - from).cast<double>();
      if (mask.at(from.x(), from.y(), from.z()) && apart_mm.norm() <= margin_mm + 1e-9)
        result.at(to.x(), to.y(), to.z()) = 1;
    });
  });
  return result;
}

Volume<std::uint8_t> random_mask(const Eigen::Matrix3d& axes, unsigned seed) {
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.linear() = axes;
  Volume<std::uint8_t> mask(Eigen::Vector3i(13, 11, 9), patient_from_voxel);
  std::mt19937 random(seed);
  for (std::uint8_t& voxel : mask.voxels) voxel = random() % 100 == 0 ? 1 : 0;
  return mask;
}

TEST(Mask, DilationIsTheDefinitionsOnEveryLattice) {
  const Eigen::Matrix3d box = Eigen::Vector3d(0.9, 1.4, 2.5).asDiagonal();
  const Eigen::Matrix3d turned = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, -1, 2).normalized()) * box;
  Eigen::Matrix3d sheared = box;  // a gantry tilted by 20 degrees, and more
  sheared(1, 2) = 2.5 * std::tan(0.35);
  sheared(0, 2) = 0.7;
  for (const Eigen::Matrix3d& axes : {box, turned, sheared})
    for (const double margin_mm : {0.0, 0.9, 2.5, 3.7, 5.0, 1000.0})
      for (const unsigned seed : {1U, 2U}) {
        const Volume<std::uint8_t> mask = random_mask(axes, seed);
        ASSERT_EQ(dilated(mask, margin_mm).voxels, dilated_by_definition(mask, margin_mm).voxels)
            << margin_mm << " mm, seed " << seed << ", axes\n"
            << axes;
      }
}

TEST(Mask, NoMarginChangesNothingAndNothingGrowsFromNothing) {
  const Volume<std::uint8_t> mask = random_mask(Eigen::Matrix3d::Identity(), 3);
  EXPECT_EQ(dilated(mask, 0.0).voxels, mask.voxels);
  const Volume<std::uint8_t> empty(mask.size, mask.patient_from_voxel);
  EXPECT_EQ(dilated(empty, 5.0).voxels, empty.voxels);
}

TEST(Mask, AMarginIsAFiniteLength) {
  const Volume<std::uint8_t> mask = random_mask(Eigen::Matrix3d::Identity(), 4);
  for (const double margin_mm : {-1.0, double{NAN}, double{INFINITY}})
    EXPECT_THROW(dilated(mask, margin_mm), UsageError);
}

}  // namespace
}  // namespace isoshift::mask_test
