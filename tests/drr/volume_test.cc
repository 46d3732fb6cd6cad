// The volume as renderers keep it: integers and floats, blocks that can be skipped, the squares that bound them, and
// the inner loop of the CPU renderer on every instruction set.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <hwy/highway.h>

#include "base/error.h"
#include "drr/cpu/march.h"
#include "drr/gl/context.h"
#include "drr/occupied_blocks.h"
#include "drr/quantized_volume.h"
#include "drr/raycast/bounding_faces.h"
#include "drr/raycast/raycast.h"
#include "tests/drr/test_views.h"

namespace isoshift::volume_test {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

std::vector<float> rendered(Renderer& renderer, const XrayView& view, const PixelSet& pixels = PixelSet::all()) {
  const Eigen::Isometry3d pose = random_poses(1).front();
  const RenderResult result = renderer.render(std::span(&view, 1), std::span(&pose, 1), pixels);
  return {result.line_integrals(0, 0).begin(), result.line_integrals(0, 0).end()};
}

TEST(QuantizedVolume, IntegersSpanZeroToTheLargestAttenuation) {
  Volume<float> ct = centered_volume(Vector3i(2, 2, 1), Vector3d::Ones(), -1000.0F);
  ct.voxels = {-1000.0F, 0.0F, 1000.0F, -540.0F};
  const QuantizedVolume u8 = quantized_attenuation(ct, {}, Beam::kKilovoltage, VolumePrecision::kU8);
  // mu of 1000 HU is 2.6 times that of water (algorithms.md), and takes 255.
  EXPECT_THAT(std::get<std::vector<std::uint8_t>>(u8.voxels), testing::ElementsAre(0, 98, 255, 45));
  EXPECT_NEAR(255 * u8.unit_per_mm, 2.6 * 0.0205, 1e-7);
  const QuantizedVolume f32 = quantized_attenuation(ct, {}, Beam::kKilovoltage, VolumePrecision::kF32);
  EXPECT_NEAR(std::get<std::vector<float>>(f32.voxels)[1] * f32.unit_per_mm, 0.0205, 1e-8);
}

TEST(QuantizedVolume, WindowedEightBitIsThePapers) {
  // -540 to 1500 HU become 0 to 255, however dense the densest voxel is.
  Volume<float> ct = centered_volume(Vector3i(2, 1, 1), Vector3d::Ones(), 0.0F);
  ct.voxels = {480.0F, 500.0F};
  const AttenuationModel windowed{.kind = AttenuationModel::Kind::kWindowed};
  const QuantizedVolume u8 = quantized_attenuation(ct, windowed, Beam::kKilovoltage, VolumePrecision::kU8);
  EXPECT_THAT(std::get<std::vector<std::uint8_t>>(u8.voxels), testing::ElementsAre(128, 130));
  EXPECT_NEAR(u8.unit_per_mm, 1.0 / 255.0, 1e-9);
}

TEST(QuantizedVolume, BoxHoldsAllThatIsNotZero) {
  Volume<float> ct = centered_volume(Vector3i(9, 8, 7), Vector3d::Ones(), -1000.0F);
  const auto box_of = [&] {
    return occupied_voxels(quantized_attenuation(ct, {}, Beam::kKilovoltage, VolumePrecision::kU16));
  };
  EXPECT_TRUE(box_of().is_empty());
  ct.at(2, 3, 4) = ct.at(5, 3, 6) = 0.0F;
  EXPECT_EQ(box_of().first, Vector3i(2, 3, 4));
  EXPECT_EQ(box_of().last, Vector3i(5, 3, 6));
}

TEST(Blocks, OneVoxelOccupiesWhereverItIsInterpolatedInto) {
  Volume<float> ct = centered_volume(Vector3i::Constant(16), Vector3d::Ones(), -1000.0F);
  ct.at(8, 3, 15) = 0.0F;
  const QuantizedVolume volume = quantized_attenuation(ct, {}, Beam::kKilovoltage, VolumePrecision::kU8);
  EXPECT_EQ(std::ranges::count(occupied_blocks(volume, 8).occupied, 1), 1);
  EXPECT_TRUE(occupied_blocks(volume, 8).at(1, 0, 1));
  // The voxel reaches from 7 to 9, 2 to 4 and 14 to 16. Blocks cover -1 to 7, 7 to 15, 15 to 23.
  const BlockGrid reached = interpolation_blocks(volume, 8);
  EXPECT_EQ(reached.size, Vector3i::Constant(3));
  EXPECT_EQ(std::ranges::count(reached.occupied, 1), 2);
  EXPECT_TRUE(reached.at(1, 0, 1));
  EXPECT_TRUE(reached.at(1, 0, 2));
}

TEST(Blocks, AreBoundedByTheirOuterFaces) {
  BlockGrid grid{.size = Vector3i(3, 1, 1), .occupied = {0, 1, 1}};
  EXPECT_EQ(bounding_faces(grid).size(), 10U);  // of twelve, two look at each other
  grid.occupied = {0, 1, 0};
  EXPECT_THAT(bounding_faces(grid),
              testing::UnorderedElementsAre(BlockFace{1, 0, 0, 0}, BlockFace{1, 0, 0, 1}, BlockFace{1, 0, 0, 2},
                                            BlockFace{1, 0, 0, 3}, BlockFace{1, 0, 0, 4}, BlockFace{1, 0, 0, 5}));
}

class PrecisionTest : public testing::TestWithParam<std::tuple<RendererKind, VolumePrecision>> {};

TEST_P(PrecisionTest, CostsWhatTheDocsSay) {
  // docs/renderers.md, "Precision". This phantom's densest voxel is bone of 1500 HU: one of 255 steps is 1.3 % of
  // water.
  const auto [kind, precision] = GetParam();
  const Volume<float> ct = phantom_ct();
  const XrayView view = centered_view(35, 96, 3.0);
  const auto image = [&](VolumePrecision kept) {
    return rendered(*make_renderer(kind, ct, {}, kBothBeams, {.gl = GlDevice::kSoftware, .precision = kept}), view);
  };
  const double error = relative_error(image(precision), image(VolumePrecision::kF32));
  RecordProperty("error", std::to_string(error));
  EXPECT_GT(error, 0.0);
  EXPECT_LT(error, precision == VolumePrecision::kU8 ? 0.005 : 5e-5) << "of " << to_string(precision);
}

INSTANTIATE_TEST_SUITE_P(All, PrecisionTest,
                         testing::Combine(testing::Values(RendererKind::kCpu, RendererKind::kRaycast,
                                                          RendererKind::kRaycastBox, RendererKind::kSplatBuffers),
                                          testing::Values(VolumePrecision::kU8, VolumePrecision::kU16)),
                         [](const auto& param) {
                           std::string name(to_string(std::get<0>(param.param)));
                           std::ranges::replace(name, '-', '_');
                           return name + "_" + std::string(to_string(std::get<1>(param.param)));
                         });

TEST(Precision, OraclesKeepFloats) {
  EXPECT_THROW(
      make_renderer(RendererKind::kSiddon, textured_volume(), {}, kBothBeams, {.precision = VolumePrecision::kU8}),
      UsageError);
}

TEST(CpuRenderer, EveryInstructionSetGivesTheSameImage) {
  const Volume<float> ct = phantom_ct();
  const XrayView view = centered_view(40, 96, 3.0), coarse = centered_view(40, 40, 8.0);
  const auto image = [&](VolumePrecision precision) {
    const auto renderer = make_renderer(RendererKind::kCpu, ct, {}, kBothBeams, {.precision = precision});
    auto all = rendered(*renderer, view);
    const auto more = rendered(*renderer, coarse);  // rays far apart
    all.insert(all.end(), more.begin(), more.end());
    return all;
  };
  const std::int64_t supported = hwy::SupportedTargets();
  for (const VolumePrecision precision : kVolumePrecisions) {
    const auto best = image(precision);
    for (std::int64_t rest = supported; rest != 0; rest &= rest - 1) {
      const std::int64_t target = rest & -rest;
      hwy::SetSupportedTargetsForTest(target);
      hwy::GetChosenTarget().DeInit();
      const auto found = image(precision);
      const double error = relative_error(found, best);
      EXPECT_LT(error, 1e-5) << march_instruction_set() << " " << to_string(precision);
      hwy::SetSupportedTargetsForTest(0);
      hwy::GetChosenTarget().DeInit();
    }
  }
}

TEST(CpuRenderer, VolumesOfNothingAreBlack) {
  const Volume<float> air = centered_volume(Vector3i::Constant(20), Vector3d::Ones(), -1000.0F);
  for (const RendererKind kind : kRendererKinds) {
    const auto renderer = make_renderer(kind, air, {}, kBothBeams, {.gl = GlDevice::kSoftware});
    EXPECT_THAT(rendered(*renderer, centered_view(0, 16, 2.0)), testing::Each(0.0F)) << to_string(kind);
  }
}

TEST(RaycastGl, LeavesResultsOnTheGpu) {
  const Volume<float> ct = textured_volume();
  RaycastGlRenderer renderer(ct, {}, kBothBeams, {.gl = GlDevice::kSoftware});
  const std::vector<XrayView> views = {centered_view(0, 24, 6.0), centered_view(70, 33, 4.0)};
  const std::vector<Eigen::Isometry3d> poses = random_poses(5);
  const PixelSet pixels = PixelSet::random(views, 0.2, 1);
  std::vector<float> expected;
  const RenderResult result = renderer.render(views, poses, pixels);
  for (std::size_t p = 0; p < poses.size(); ++p)
    for (std::size_t v = 0; v < views.size(); ++v) {
      const auto part = result.line_integrals(p, v);
      expected.insert(expected.end(), part.begin(), part.end());
    }
  Buffer& left = renderer.render_on_gpu(views, poses, pixels);
  std::vector<float> found;
  left.append_to(found, expected.size());
  EXPECT_EQ(found, expected);
}

TEST(RaycastGl, SmallDispatchesRenderTheSame) {
  const Volume<float> ct = textured_volume();
  const std::vector<XrayView> views = {centered_view(0, 24, 6.0), centered_view(70, 33, 4.0)};  // 24: in squares
  const std::vector<Eigen::Isometry3d> poses = random_poses(5);
  const RenderResult expected = make_renderer(RendererKind::kRaycast, ct, {}, kBothBeams, {.gl = GlDevice::kSoftware})
                                    ->render(views, poses, PixelSet::all());
  for (const std::size_t rays : {1000UL, 4000UL}) {  // parts of a pose, and two poses of five
    RaycastGlRenderer renderer(ct, {}, kBothBeams, {.gl = GlDevice::kSoftware, .rays_per_dispatch = rays});
    renderer.poison(poses.size() * (24 * 24 + 33 * 33));
    const RenderResult found = renderer.render(views, poses, PixelSet::all());
    for (std::size_t p = 0; p < poses.size(); ++p)
      for (std::size_t v = 0; v < views.size(); ++v)
        EXPECT_THAT(found.line_integrals(p, v), testing::ElementsAreArray(expected.line_integrals(p, v))) << rays;
  }
}

TEST(RaycastGl, TwoRenderersDoNotDisturbEachOther) {
  const Volume<float> ct = textured_volume();
  const XrayView view = centered_view(20, 40, 4.0);
  const RendererOptions software{.gl = GlDevice::kSoftware};
  for (const RendererKind kind : kRendererKinds) {
    if (!uses_gl(kind)) continue;
    auto first = make_renderer(kind, ct, {}, kBothBeams, software);
    const auto expected = rendered(*first, view);
    auto second = make_renderer(kind, ct, {}, kBothBeams, software);
    EXPECT_EQ(rendered(*second, view), expected) << to_string(kind);
    EXPECT_EQ(rendered(*first, view), expected) << to_string(kind);
    first.reset();
    EXPECT_EQ(rendered(*second, view), expected) << to_string(kind) << " after the first one's end";
  }
}

TEST(Cuberille, RefusesOtherBlockEdges) {
  EXPECT_THROW(make_renderer(RendererKind::kRaycastCuberille, textured_volume(), {}, kBothBeams,
                             {.gl = GlDevice::kSoftware, .block_edge = 3}),
               UsageError);
}

TEST(Cuberille, EveryBlockEdgeGivesTheSameImage) {
  const Volume<float> ct = phantom_ct();
  const XrayView view = centered_view(35, 96, 3.0);
  const auto oracle = rendered(*make_renderer(RendererKind::kTrilinear, ct, {}, kBothBeams), view);
  for (const int edge : {1, 2, 4, 8}) {
    const RendererOptions options{.gl = GlDevice::kSoftware, .block_edge = edge};
    const auto renderer = make_renderer(RendererKind::kRaycastCuberille, ct, {}, kBothBeams, options);
    EXPECT_LT(relative_error(rendered(*renderer, view), oracle), 0.005) << "edge " << edge;
  }
}

TEST(PixelSet, RandomIsTheSameForTheSameSeed) {
  const std::vector<XrayView> views = {centered_view(0, 100, 1.0), centered_view(90, 50, 1.0)};
  const PixelSet pixels = PixelSet::random(views, 0.25, 7);
  EXPECT_EQ(pixels.of_view[0].size(), 2500U);
  EXPECT_EQ(pixels.of_view[1].size(), 625U);
  EXPECT_TRUE(std::ranges::is_sorted(pixels.of_view[0], std::less_equal()));  // rising: none twice
  EXPECT_EQ(PixelSet::random(views, 0.25, 7).of_view, pixels.of_view);
  EXPECT_NE(PixelSet::random(views, 0.25, 8).of_view, pixels.of_view);
}

}  // namespace
}  // namespace isoshift::volume_test
