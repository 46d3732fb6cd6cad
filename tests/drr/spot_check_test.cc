// Rays of a CT computed again on the CPU: right renderers pass, and those that render something else do not.

#include "drr/spot_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drr/cpu/trilinear.h"
#include "tests/drr/test_views.h"

namespace isoshift::spot_check_test {
namespace {

const std::vector<XrayView>& views() {
  static const std::vector<XrayView> all = {centered_view(20, 200, 1.5), centered_view(110, 180, 1.6)};
  return all;
}

const Volume<float>& ct() {
  static const Volume<float> phantom = phantom_ct();
  return phantom;
}

SpotCheck check_of(Renderer& renderer) { return check_rays(renderer, ct(), {}, views(), random_poses(1).front()); }

TEST(SpotCheckTest, TheReferenceIsThatOfTheOracle) {
  const Volume<float> textured = textured_volume();
  const Eigen::Isometry3d pose = random_poses(1).front();
  const XrayView view = centered_view(35, 30, 5.0);
  TrilinearRenderer oracle(textured, {}, kBothBeams);
  const std::vector<std::uint32_t> pixels = {0, 31, 434, 435, 466, 899};
  const RenderResult expected = oracle.render(std::span(&view, 1), std::span(&pose, 1), {.of_view = {pixels}});
  const std::vector<double> found = exact_line_integrals(textured, {}, view, pose, pixels);
  for (std::size_t n = 0; n < pixels.size(); ++n)
    EXPECT_NEAR(found[n], expected.line_integrals(0, 0)[n], 1e-6 * (1.0 + found[n])) << n;
  EXPECT_GT(std::ranges::max(found), 0.1);
}

TEST(SpotCheckTest, RayCastersPass) {
  for (const RendererKind kind : {RendererKind::kCpu, RendererKind::kRaycast})
    for (const VolumePrecision precision : {VolumePrecision::kU8, VolumePrecision::kU16}) {
      const auto renderer =
          make_renderer(kind, ct(), {}, kBothBeams, {.gl = GlDevice::kSoftware, .precision = precision});
      const SpotCheck check = check_of(*renderer);
      EXPECT_EQ(check.failure, std::nullopt);
      EXPECT_NEAR(static_cast<double>(check.rays), 500.0, 2.0);
      EXPECT_GT(check.rms, 0.0);
    }
}

TEST(SpotCheckTest, AVolumeHalfAVoxelBesideFails) {
  Volume<float> moved = ct();
  moved.patient_from_voxel = moved.patient_from_voxel * Eigen::Translation3d(0.5, 0.0, 0.0);
  EXPECT_THAT(check_of(*make_renderer(RendererKind::kTrilinear, moved, {}, kBothBeams)).failure.value_or("passed"),
              testing::HasSubstr("rays of the DRRs differ from those of the CPU by"));
}

TEST(SpotCheckTest, ACtOfAnotherThresholdFails) {
  EXPECT_NE(check_of(*make_renderer(RendererKind::kTrilinear, ct(), {.threshold_hu = 200.0}, kBothBeams)).failure,
            std::nullopt);
}

TEST(SpotCheckTest, AVolumeOfNothingPassesAsNothing) {
  const Volume<float> air = centered_volume(Eigen::Vector3i::Constant(20), Eigen::Vector3d::Ones(), -1000.0F);
  const auto renderer = make_renderer(RendererKind::kCpu, air, {}, kBothBeams);
  EXPECT_EQ(check_rays(*renderer, air, {}, views(), Eigen::Isometry3d::Identity()).failure, std::nullopt);
}

}  // namespace
}  // namespace isoshift::spot_check_test
