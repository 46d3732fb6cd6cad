#include "io/dicom/structure_mask.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "base/error.h"
#include "tests/support/small_study.h"

namespace isoshift::structure_mask_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// 12 x 10 x 8 voxels of 1 x 1 x 2 mm; voxel (i, j, k) at (i, j, 2 k).
const Eigen::Vector3i kSize(12, 10, 8);
Eigen::Affine3d lattice() {
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.linear() = Eigen::Vector3d(1, 1, 2).asDiagonal();
  return patient_from_voxel;
}

Structure drawn(const std::vector<std::vector<Eigen::Vector3d>>& contours) {
  Structure structure{.number = 1, .name = "Spine"};
  for (const auto& points_mm : contours) structure.contours.push_back({points_mm, std::nullopt});
  return structure;
}

std::string error_of(const Structure& structure) {
  try {
    mask_of(structure, kSize, lattice());
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

int count(const Volume<std::uint8_t>& mask) { return std::accumulate(mask.voxels.begin(), mask.voxels.end(), 0); }

// One slice as text, a line per row.
std::string picture(const Volume<std::uint8_t>& mask, int k) {
  std::string text;
  for (int j = 0; j < mask.size.y(); ++j) {
    for (int i = 0; i < mask.size.x(); ++i) text += mask.at(i, j, k) ? '#' : '.';
    text += '\n';
  }
  return text;
}

std::vector<int> filled_slices(const Volume<std::uint8_t>& mask) {
  std::vector<int> slices;
  for (int k = 0; k < mask.size.z(); ++k)
    if (picture(mask, k).find('#') != std::string::npos) slices.push_back(k);
  return slices;
}

TEST(StructureMask, HoldsTheVoxelsWhoseCentersLieInTheContour) {
  const auto mask = mask_of(drawn({rectangle({5.5, 4.5, 6}, 4, 2)}), kSize, lattice());
  EXPECT_EQ(count(mask), 8);  // columns 4 to 7, rows 4 and 5
  EXPECT_EQ(mask.at(4, 4, 3), 1);
  EXPECT_EQ(mask.at(7, 5, 3), 1);
  EXPECT_EQ(mask.at(8, 5, 3), 0);
  EXPECT_EQ(mask.at(7, 6, 3), 0);
}

TEST(StructureMask, ATriangleHasItsArea) {
  Eigen::Affine3d fine = Eigen::Affine3d::Identity();
  fine.linear() = Eigen::Vector3d(0.05, 0.05, 2).asDiagonal();
  const auto mask = mask_of(drawn({{{1, 1, 2}, {9, 2, 2}, {3, 7, 2}}}), Eigen::Vector3i(240, 200, 3), fine);
  EXPECT_NEAR(count(mask) * 0.05 * 0.05, 23.0, 0.1);  // (8 * 6 - 1 * 2) / 2
}

TEST(StructureMask, AContourWithinAnotherIsAHole) {
  const auto mask = mask_of(drawn({rectangle({5.5, 4.5, 6}, 8, 6), rectangle({5.5, 4.5, 6}, 4, 2)}), kSize, lattice());
  EXPECT_EQ(picture(mask, 3),
            "............\n"
            "............\n"
            "..########..\n"
            "..########..\n"
            "..##....##..\n"
            "..##....##..\n"
            "..########..\n"
            "..########..\n"
            "............\n"
            "............\n");
}

// The same hole, drawn as one contour that goes in and comes back along one slanting line.
TEST(StructureMask, AKeyholeIsThatHoleToo) {
  const auto outer = rectangle({5.5, 4.5, 6}, 8, 6), inner = rectangle({5.5, 4.5, 6}, 4, 2);
  std::vector<Eigen::Vector3d> keyhole = outer;
  keyhole.push_back(outer[0]);
  for (const int corner : {0, 3, 2, 1, 0}) keyhole.push_back(inner[static_cast<std::size_t>(corner)]);
  EXPECT_EQ(mask_of(drawn({keyhole}), kSize, lattice()).voxels,
            mask_of(drawn({outer, inner}), kSize, lattice()).voxels);
}

TEST(StructureMask, TheWayRoundDoesNotMatter) {
  std::vector<Eigen::Vector3d> points_mm = {{1.2, 0.7, 6}, {9.9, 3.1, 6}, {6.4, 8.8, 6}, {2.3, 6.1, 6}};
  const auto mask = mask_of(drawn({points_mm}), kSize, lattice());
  std::ranges::reverse(points_mm);
  EXPECT_EQ(mask_of(drawn({points_mm}), kSize, lattice()).voxels, mask.voxels);
}

TEST(StructureMask, WhatReachesBeyondTheVolumeIsCutOff) {
  const auto mask = mask_of(drawn({rectangle({0, 0, 6}, 4, 2000)}), kSize, lattice());
  EXPECT_EQ(count(mask), 2 * 10);  // columns 0 and 1; a center on the right edge is outside
  EXPECT_EQ(count(mask_of(drawn({rectangle({0, 0, 6}, 1e9, 1e9)}), kSize, lattice())), 12 * 10);
}

// Slices lie at 0, 2, ... 14 mm.
TEST(StructureMask, APlaneReachesHalfWayToTheNextOne) {
  const auto wide = [](double z_mm) { return rectangle({5.5, 4.5, z_mm}, 8, 6); };
  const auto narrow = [](double z_mm) { return rectangle({5.5, 4.5, z_mm}, 4, 2); };
  // Planes at 2 and 8 mm: the border is at 5 mm; beyond them half of 6 mm.
  const auto mask = mask_of(drawn({narrow(8), wide(2)}), kSize, lattice());
  EXPECT_EQ(picture(mask, 2), picture(mask, 0));  // 4 mm: the wide one
  EXPECT_EQ(picture(mask, 3), picture(mask, 5));  // 6 mm: the narrow one
  EXPECT_NE(picture(mask, 2), picture(mask, 3));
  EXPECT_THAT(filled_slices(mask), ElementsAre(0, 1, 2, 3, 4, 5));
  // A slice half-way belongs to the plane above; so every slice counts once.
  const auto halves = mask_of(drawn({wide(4), narrow(8)}), kSize, lattice());
  EXPECT_EQ(picture(halves, 3), picture(halves, 4));
}

TEST(StructureMask, TheFirstAndLastPlaneReachHalfASlab) {
  const auto square = [](double z_mm) { return rectangle({5.5, 4.5, z_mm}, 8, 6); };
  // Ends by the smallest distance of planes, 4 mm: from 2 up to, not including, 16 mm.
  EXPECT_THAT(filled_slices(mask_of(drawn({square(4), square(8), square(14)}), kSize, lattice())),
              ElementsAre(1, 2, 3, 4, 5, 6, 7));
  // By the contour's own thickness: from 3 mm.
  Structure structure = drawn({square(4), square(8)});
  structure.contours[0].slab_thickness_mm = 2.0;
  EXPECT_THAT(filled_slices(mask_of(structure, kSize, lattice())), ElementsAre(2, 3, 4));
  // A single plane: by the distance of slices; by its thickness.
  structure = drawn({square(6)});
  EXPECT_THAT(filled_slices(mask_of(structure, kSize, lattice())), ElementsAre(3));
  structure.contours[0].slab_thickness_mm = 5.0;
  EXPECT_THAT(filled_slices(mask_of(structure, kSize, lattice())), ElementsAre(2, 3, 4));
}

// The same anatomy, drawn between the slices: turned, on slices counted downwards, and sheared by a tilted gantry.
TEST(StructureMask, FollowsTheVolumesAxes) {
  const Structure structure = drawn({{{2.3, 1.1, 5}, {9.2, 2.2, 5}, {4.1, 8.3, 5}}, rectangle({5.2, 4.7, 9}, 3, 5)});
  const auto mask = mask_of(structure, kSize, lattice());
  Eigen::Affine3d moved = Eigen::Affine3d::Identity();
  moved.rotate(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())).pretranslate(Eigen::Vector3d(5, 6, 7));
  Structure turned = structure;
  for (Contour& contour : turned.contours)
    for (Eigen::Vector3d& point_mm : contour.points_patient_mm) point_mm = moved * point_mm;
  EXPECT_EQ(mask_of(turned, kSize, moved * lattice()).voxels, mask.voxels);

  Eigen::Affine3d downwards = lattice();
  downwards.linear().col(2) *= -1.0;
  downwards.translation() = lattice() * Eigen::Vector3d(0, 0, kSize.z() - 1);
  const auto from_above = mask_of(structure, kSize, downwards);
  for (int k = 0; k < kSize.z(); ++k) EXPECT_EQ(picture(from_above, kSize.z() - 1 - k), picture(mask, k)) << k;
  EXPECT_THAT(filled_slices(mask_of(drawn({rectangle({5, 5, 6}, 4, 4)}), kSize, downwards)), ElementsAre(4));

  // Every slice one row further: the same centers, so the same voxels but for their row.
  Eigen::Affine3d sheared = lattice();
  sheared.linear().col(2).y() = 1.0;
  const auto tilted = mask_of(structure, kSize, sheared);
  for (int k = 0; k < kSize.z(); ++k)
    for (int j = k; j < kSize.y(); ++j) EXPECT_EQ(tilted.at(4, j - k, k), mask.at(4, j, k)) << j << " " << k;
}

TEST(StructureMask, ContoursAcrossTheSlicesAreRefused) {
  EXPECT_EQ(error_of(drawn({{{2, 2, 2}, {8, 2, 2}, {8, 2, 8}, {2, 2, 8}}})),
            "structure 1 \"Spine\": a contour spans 6.00 mm across the slices (ContourData (3006,0050)), expected one "
            "parallel to them.\n       Only structures drawn on the slices of the CT can be used");
}

TEST(StructureMask, AStructureBesideTheVolumeIsRefused) {
  EXPECT_THAT(error_of(drawn({rectangle({5, 5, 100}, 4, 4)})), HasSubstr("no voxel of the CT lies in it"));
  EXPECT_THAT(error_of(drawn({rectangle({-50, 5, 6}, 4, 4)})), HasSubstr("no voxel of the CT lies in it"));
  EXPECT_THAT(error_of(drawn({})), HasSubstr("no voxel of the CT lies in it"));
}

}  // namespace
}  // namespace isoshift::structure_mask_test
