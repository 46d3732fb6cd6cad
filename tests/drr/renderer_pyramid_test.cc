#include "drr/renderer_pyramid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "tests/drr/test_views.h"
#include "tests/support/pose_near.h"

namespace isoshift::renderer_pyramid_test {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

std::vector<float> rendered(Renderer& renderer, const XrayView& view) {
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const RenderResult result = renderer.render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all());
  const auto pixels = result.line_integrals(0, 0);
  return {pixels.begin(), pixels.end()};
}

// Attenuation times volume, of the whole CT.
double total_attenuation(const Volume<float>& hu, const AttenuationModel& model) {
  const Volume<float> attenuation = attenuation_volume(hu, model, Beam::kKilovoltage);
  return std::accumulate(attenuation.voxels.begin(), attenuation.voxels.end(), 0.0) *
         std::abs(hu.patient_from_voxel.linear().determinant());
}

AttenuationModel windowed() { return {.kind = AttenuationModel::Kind::kWindowed}; }

TEST(CoarserCt, OfAUniformBlockGivesTheSameDrr) {
  const Volume<float> ct = centered_volume(Vector3i::Constant(48), Vector3d(1.0, 1.5, 2.0), 300.0F);
  const CoarserCt coarse = coarser_ct(ct, {}, {4, 3, 2});
  EXPECT_EQ(coarse.hu.size, Vector3i(12, 16, 24));
  for (const double gantry_deg : {0.0, 90.0}) {
    const XrayView view = centered_view(gantry_deg, 41, 4.0);
    const auto fine_drr = rendered(*make_renderer(RendererKind::kCpu, ct, {}, kBothBeams), view);
    const auto coarse_drr = rendered(*make_renderer(RendererKind::kCpu, coarse.hu, coarse.model, kBothBeams), view);
    // Through the middle, and in all: the rim of a coarse voxel is wider, but as much lies within it.
    EXPECT_NEAR(coarse_drr[20 * 41 + 20], fine_drr[20 * 41 + 20], 0.01 * fine_drr[20 * 41 + 20]);
    EXPECT_NEAR(mean_of(coarse_drr), mean_of(fine_drr), 0.01 * mean_of(fine_drr));
  }
}

TEST(CoarserCt, OfAHeadGivesAlmostTheSameDrr) {
  const Volume<float> ct = phantom_ct();
  const CoarserCt coarse = coarser_ct(ct, {}, {2, 2, 1});
  const XrayView view = centered_view(0, 64, 5.0);
  const auto fine_drr = rendered(*make_renderer(RendererKind::kCpu, ct, {}, kBothBeams), view);
  const auto coarse_drr = rendered(*make_renderer(RendererKind::kCpu, coarse.hu, coarse.model, kBothBeams), view);
  EXPECT_GT(correlation(coarse_drr, fine_drr), 0.995);
  EXPECT_NEAR(mean_of(coarse_drr), mean_of(fine_drr), 0.02 * mean_of(fine_drr));
}

TEST(CoarserCt, KeepsTheMeanAttenuation) {
  // Where attenuation is linear in HU: below water, and in the window.
  Volume<float> soft = textured_volume();
  for (float& hu : soft.voxels) hu = std::min(hu, 0.0F);
  const CoarserCt coarse = coarser_ct(soft, {}, {2, 4, 3});
  EXPECT_NEAR(total_attenuation(coarse.hu, coarse.model), total_attenuation(soft, {}),
              1e-4 * total_attenuation(soft, {}));
  Volume<float> any = textured_volume();
  any.at(3, 4, 5) = 3000.0F;  // beyond the window: no more than its upper end
  const CoarserCt in_window = coarser_ct(any, windowed(), {2, 4, 3});
  EXPECT_NEAR(total_attenuation(in_window.hu, in_window.model), total_attenuation(any, windowed()),
              1e-4 * total_attenuation(any, windowed()));
}

TEST(CoarserCt, WhatIsBelowTheThresholdCountsAsNothingBeforeItIsAveraged) {
  Volume<float> ct = centered_volume({2, 2, 2}, Vector3d::Constant(1.0), 0.0F);
  for (const int k : {0, 1})
    for (const int j : {0, 1}) ct.at(0, j, k) = -600.0F;  // of half of the block's voxels, as in a lung
  const CoarserCt counted = coarser_ct(ct, {.threshold_hu = -1000.0}, {2, 2, 2});
  EXPECT_NEAR(counted.hu.voxels[0], -300.0F, 1e-3);
  const CoarserCt dropped = coarser_ct(ct, {.threshold_hu = -540.0}, {2, 2, 2});
  EXPECT_NEAR(dropped.hu.voxels[0], -500.0F, 1e-3);  // as air
  // And what is left of a block is not dropped again for being below the threshold.
  ct.at(1, 0, 0) = ct.at(1, 1, 0) = ct.at(1, 0, 1) = -600.0F;
  const AttenuationModel model{.threshold_hu = -540.0};
  const CoarserCt little = coarser_ct(ct, model, {2, 2, 2});
  EXPECT_NEAR(total_attenuation(little.hu, little.model), total_attenuation(ct, model), 1e-6);
  EXPECT_GT(total_attenuation(ct, model), 0.0);
}

TEST(CoarserCt, ItsVoxelsLieInTheMiddleOfTheirBlocks) {
  const Volume<float> ct = textured_volume();  // 16 x 20 x 12, oblique
  const Vector3i block(3, 4, 5);
  const CoarserCt coarse = coarser_ct(ct, {}, block);
  EXPECT_EQ(coarse.hu.size, Vector3i(6, 5, 3));  // the last blocks reach beyond the CT
  for (const Vector3i& at : {Vector3i(0, 0, 0), Vector3i(1, 2, 0), Vector3i(5, 4, 2)}) {
    const Vector3d first = (at.array() * block.array()).cast<double>();
    const Vector3d last = first + (block.array() - 1).cast<double>().matrix();
    const Vector3d middle = 0.5 * (ct.patient_from_voxel * first + ct.patient_from_voxel * last);
    EXPECT_THAT(Vector3d(coarse.hu.patient_from_voxel * at.cast<double>()), VectorNear(middle, 1e-9));
  }
  EXPECT_THAT(coarse.hu.spacing_mm(), VectorNear(Vector3d(9.0, 10.0, 20.0), 1e-9));
}

TEST(CoarserCt, BeyondTheCtIsNothing) {
  const Volume<float> ct = centered_volume({5, 4, 4}, Vector3d::Constant(1.0), 0.0F);
  const CoarserCt coarse = coarser_ct(ct, {}, {2, 2, 2});
  ASSERT_EQ(coarse.hu.size, Vector3i(3, 2, 2));
  EXPECT_NEAR(coarse.hu.at(1, 1, 1), 0.0F, 1e-3);
  EXPECT_NEAR(coarse.hu.at(2, 1, 1), -500.0F, 1e-3);  // half of the block
  EXPECT_NEAR(total_attenuation(coarse.hu, coarse.model), total_attenuation(ct, {}), 1e-6);
  const CoarserCt in_window = coarser_ct(ct, windowed(), {2, 2, 2});
  EXPECT_NEAR(total_attenuation(in_window.hu, in_window.model), total_attenuation(ct, windowed()), 1e-3);
}

// Of a pyramid, the level with the same DRR as one of these CTs.
std::vector<float> drr_of_level(const Volume<float>& ct, const Vector3i& block) {
  const CoarserCt coarse = coarser_ct(ct, {}, block);
  return rendered(*make_renderer(RendererKind::kCpu, coarse.hu, coarse.model, kBothBeams), centered_view(0, 32, 4.0));
}

std::vector<float> drr_of_pyramid(const RendererPyramid& pyramid, double edge_mm) {
  return rendered(pyramid.with_voxels_up_to(edge_mm), centered_view(0, 32, 4.0));
}

Volume<float> textured(const Vector3i& size, const Vector3d& spacing_mm) {
  Volume<float> ct = centered_volume(size, spacing_mm, 0.0F);
  for (std::size_t n = 0; n < ct.voxels.size(); ++n) ct.voxels[n] = static_cast<float>((n * 7919) % 1000);
  return ct;
}

TEST(RendererPyramid, GivesTheCoarsestVoxelsUpToTheEdge) {
  const Volume<float> ct = textured(Vector3i::Constant(40), Vector3d::Constant(1.0));
  const RendererPyramid pyramid(RendererKind::kCpu, ct, {}, kBothBeams);
  EXPECT_EQ(drr_of_pyramid(pyramid, 1.0), drr_of_level(ct, {1, 1, 1}));
  EXPECT_EQ(&pyramid.with_voxels_up_to(1.0), &pyramid.finest());
  EXPECT_EQ(drr_of_pyramid(pyramid, 2.0), drr_of_level(ct, {2, 2, 2}));
  EXPECT_EQ(drr_of_pyramid(pyramid, 3.5), drr_of_level(ct, {2, 2, 2}));
  EXPECT_EQ(drr_of_pyramid(pyramid, 4.0), drr_of_level(ct, {4, 4, 4}));
  EXPECT_EQ(drr_of_pyramid(pyramid, 100.0), drr_of_level(ct, {4, 4, 4}));
  // Nothing asked for, or nothing as fine.
  EXPECT_EQ(&pyramid.with_voxels_up_to(0.0), &pyramid.finest());
  EXPECT_EQ(&pyramid.with_voxels_up_to(0.5), &pyramid.finest());
  EXPECT_NEAR(pyramid.voxel_mm(), 1.0, 1e-12);
}

TEST(RendererPyramid, ThickSlicesAreLeftAloneAsLongAsTheyAreThickEnough) {
  // In plane four voxels become one, along z one or two stay.
  const Volume<float> ct = textured({48, 48, 16}, {0.5, 0.5, 2.0});
  const RendererPyramid pyramid(RendererKind::kCpu, ct, {}, kBothBeams);
  EXPECT_EQ(drr_of_pyramid(pyramid, 2.0), drr_of_level(ct, {4, 4, 1}));
  EXPECT_EQ(drr_of_pyramid(pyramid, 4.0), drr_of_level(ct, {8, 8, 2}));
  EXPECT_NEAR(pyramid.voxel_mm(), std::cbrt(0.5), 1e-12);
}

TEST(RendererPyramid, OfACoarseCtHasOneLevel) {
  const Volume<float> ct = textured(Vector3i::Constant(10), Vector3d::Constant(5.0));
  const RendererPyramid pyramid(RendererKind::kCpu, ct, {}, kBothBeams);
  for (const double edge_mm : {0.0, 2.0, 4.0, 8.0}) EXPECT_EQ(&pyramid.with_voxels_up_to(edge_mm), &pyramid.finest());
}

TEST(RendererPyramid, EveryLevelIsOfTheKindAskedFor) {
  const Volume<float> ct = textured(Vector3i::Constant(24), Vector3d::Constant(1.0));
  const RendererPyramid pyramid(RendererKind::kSiddon, ct, {}, kBothBeams);
  for (const double edge_mm : {1.0, 2.0, 4.0})
    EXPECT_EQ(pyramid.with_voxels_up_to(edge_mm).kind(), RendererKind::kSiddon);
}

}  // namespace
}  // namespace isoshift::renderer_pyramid_test
