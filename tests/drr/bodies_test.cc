// DRRs of bodies: they add up to that of the CT, at any poses to the sum of the oracle's, and bend as the CT does.

#include "drr/bodies.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "geometry/rotation.h"
#include "tests/drr/test_views.h"
#include "tests/support/bent_scene.h"

namespace isoshift::bodies_test {
namespace {

using Eigen::Vector3d;

constexpr std::array kKilovoltage = {Beam::kKilovoltage};

std::vector<std::uint32_t> all_pixels(const XrayView& view) {
  std::vector<std::uint32_t> pixels(static_cast<std::size_t>(view.columns) * view.rows);
  std::iota(pixels.begin(), pixels.end(), 0U);
  return pixels;
}

std::vector<float> sum_of(const BodyRenderers& bodies, const XrayView& view,
                          const std::vector<Eigen::Isometry3d>& poses) {
  const std::vector<std::uint32_t> pixels = all_pixels(view);
  std::vector<float> sum(pixels.size());
  for (std::size_t body = 0; body < bodies.count(); ++body) bodies.add(body, view, poses[body], pixels, sum);
  return sum;
}

std::vector<float> drr_of(Renderer& renderer, const XrayView& view, const Eigen::Isometry3d& pose) {
  const RenderResult result = renderer.render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all());
  return {result.line_integrals(0, 0).begin(), result.line_integrals(0, 0).end()};
}

class BodiesTest : public testing::Test {
 protected:
  Volume<float> ct_ = phantom_ct();
  std::vector<BodyShare> shares_ = slabs(ct_, {-30.0, 15.0}, 16.0);
  BodyRenderers bodies_{RendererKind::kCpu, ct_, {}, kKilovoltage, shares_};
  std::vector<XrayView> views_ = {centered_view(0.0, 60, 5.0), centered_view(70.0, 50, 6.0)};
};

TEST_F(BodiesTest, AtOnePoseAddUpToTheWholeCt) {
  const auto whole = make_renderer(RendererKind::kCpu, ct_, {}, kKilovoltage);
  for (const XrayView& view : views_)
    for (const Eigen::Isometry3d& pose : random_poses(3))
      EXPECT_LT(relative_error(sum_of(bodies_, view, {pose, pose, pose}), drr_of(*whole, view, pose)), 1e-3);
}

// Written down with the shares' definition: attenuation times share, by the oracle and at each body's own pose.
TEST_F(BodiesTest, AtDifferentPosesAreTheSumOfTheOracles) {
  const std::vector<Eigen::Isometry3d> poses = random_poses(3);
  const Volume<float> attenuation = attenuation_volume(ct_, {}, Beam::kKilovoltage);
  for (const XrayView& view : views_) {
    std::vector<float> expected(static_cast<std::size_t>(view.columns) * view.rows);
    for (std::size_t body = 0; body < shares_.size(); ++body) {
      Volume<float> part = attenuation;
      for (std::size_t n = 0; n < part.voxels.size(); ++n)
        part.voxels[n] *= static_cast<float>(shares_[body].voxels[n]) / 255.0F;
      const auto oracle = make_renderer(RendererKind::kTrilinear, AttenuationByBeam{{Beam::kKilovoltage, part}});
      const std::vector<float> drr = drr_of(*oracle, view, poses[body]);
      for (std::size_t n = 0; n < drr.size(); ++n) expected[n] += drr[n];
    }
    // The bound is that of the `cpu` renderer for whole CTs (RendererTest).
    EXPECT_LT(relative_error(sum_of(bodies_, view, poses), expected), 0.01);
    // With the oracle's interpolation only rounding is left, and shares of voxels beyond the boxes: none.
    const BodyRenderers oracles(RendererKind::kTrilinear, ct_, {}, kKilovoltage, shares_);
    EXPECT_LT(relative_error(sum_of(oracles, view, poses), expected), 1e-5);
  }
}

// The CT itself, warped: every place moves by the mean of the bodies' motions, weighed by their shares there. A twist
// and a shift across it keep volumes as they are; where a bend stretches tissue, bodies keep its mass and the warp its
// density. A smooth CT: where there are edges, interpolating the warped CT blurs them.
TEST(Bodies, AgreeWithTheCtWarped) {
  const Volume<float> ct = smooth_volume();
  const std::vector<BodyShare> shares = slabs(ct, {-20.0, 15.0}, 25.0);
  const BodyRenderers bodies(RendererKind::kCpu, ct, kAll, kKilovoltage, shares);
  const auto twisted = [](double deg, const Vector3d& across) -> Eigen::Isometry3d {
    return Eigen::Translation3d(across) * Eigen::AngleAxisd(rad_from_deg(deg), Vector3d::UnitZ());
  };
  const std::vector<Eigen::Isometry3d> motions = {twisted(6.0, {2, 1, 0}), Eigen::Isometry3d::Identity(),
                                                  twisted(-6.0, {-1, 3, 0})};
  const Volume<float> attenuation = attenuation_volume(ct, kAll, Beam::kKilovoltage);
  const Eigen::Affine3d voxel_from_patient = ct.patient_from_voxel.inverse();
  const auto interpolated = [&](const auto& volume, const Vector3d& patient) {
    const Vector3d voxel = voxel_from_patient * patient;
    const Eigen::Vector3i lower = voxel.array().floor().cast<int>();
    double value = 0.0;
    for (int n = 0; n < 8; ++n) {
      const Eigen::Vector3i at = lower + Eigen::Vector3i(n & 1, (n >> 1) & 1, n >> 2);
      if ((at.array() < 0).any() || (at.array() >= volume.size.array()).any()) continue;
      value +=
          (1.0 - (voxel - at.template cast<double>()).cwiseAbs().array()).prod() * volume.at(at.x(), at.y(), at.z());
    }
    return value;
  };
  Volume<float> warped(ct.size, ct.patient_from_voxel);
  for (int k = 0; k < ct.size.z(); ++k)
    for (int j = 0; j < ct.size.y(); ++j)
      for (int i = 0; i < ct.size.x(); ++i) {
        // Where it came from, by fixed-point iteration.
        const Vector3d here = ct.patient_from_voxel * Vector3d(i, j, k);
        Vector3d from = here;
        for (int n = 0; n < 6; ++n) {
          Vector3d moved = Vector3d::Zero();
          for (std::size_t body = 0; body < 3; ++body)
            moved += interpolated(shares[body], from) / 255.0 * (motions[body] * from - from);
          from = here - moved;
        }
        warped.at(i, j, k) = static_cast<float>(interpolated(attenuation, from));
      }
  const auto renderer = make_renderer(RendererKind::kCpu, AttenuationByBeam{{Beam::kKilovoltage, warped}});
  const auto still = make_renderer(RendererKind::kCpu, AttenuationByBeam{{Beam::kKilovoltage, attenuation}});
  const Eigen::Isometry3d pose = random_poses(1).front();
  for (const XrayView& view : {centered_view(0.0, 60, 4.0), centered_view(70.0, 50, 5.0)}) {
    const std::vector<float> expected = drr_of(*renderer, view, pose);
    const double found =
        relative_error(sum_of(bodies, view, {pose * motions[0], pose * motions[1], pose * motions[2]}), expected);
    EXPECT_LT(found, 0.02);
    EXPECT_GT(relative_error(drr_of(*still, view, pose), expected), 3.0 * found);  // the bend can be seen
  }
}

TEST_F(BodiesTest, DerivativesAreThoseOfTheSumByOneBodysMotion) {
  const XrayView& view = views_[1];
  const std::vector<Eigen::Isometry3d> poses = random_poses(3);
  const std::vector<std::uint32_t> pixels = all_pixels(view);
  for (std::size_t body = 0; body < 3; ++body) {
    const BodyDrr part = bodies_.part_with_derivatives(body, view, poses[body], pixels);
    std::vector<MotionDerivatives> derivatives(pixels.size(), MotionDerivatives::Zero());
    for (std::size_t n = 0; n < part.places.size(); ++n) derivatives[part.places[n]] = part.derivatives[n];
    std::vector<Eigen::Isometry3d> before = poses, behind = poses;
    constexpr double kStep = 0.2;
    before[body] = Eigen::Translation3d(0.0, -kStep, 0.0) * poses[body];
    behind[body] = Eigen::Translation3d(0.0, kStep, 0.0) * poses[body];
    const std::vector<float> low = sum_of(bodies_, view, before), high = sum_of(bodies_, view, behind);
    double wrong = 0.0, all = 0.0;
    for (std::size_t n = 0; n < pixels.size(); ++n) {
      const double expected = (high[n] - low[n]) / (2.0 * kStep);
      wrong += std::pow(derivatives[n][1] - expected, 2);
      all += expected * expected;
    }
    EXPECT_LT(std::sqrt(wrong / all), 0.1);  // edges of bone are sharp here
  }
}

TEST_F(BodiesTest, ABodyOfNothingAddsNothing) {
  shares_.emplace_back(ct_.size, ct_.patient_from_voxel);
  const BodyRenderers four(RendererKind::kCpu, ct_, {}, kKilovoltage, shares_);
  const std::vector<Eigen::Isometry3d> poses(4, Eigen::Isometry3d::Identity());
  EXPECT_EQ(sum_of(four, views_[0], poses), sum_of(bodies_, views_[0], poses));
}

TEST_F(BodiesTest, SharesMayHaveALatticeOfTheirOwn) {
  const Volume<float> coarse = centered_volume({60, 70, 60}, Vector3d::Constant(4.0), 0.0F);
  const std::vector<BodyShare> shares = slabs(coarse, {-30.0, 15.0}, 16.0);
  const BodyRenderers bodies(RendererKind::kCpu, ct_, {}, kKilovoltage, shares);
  const std::vector<Eigen::Isometry3d> poses = random_poses(3);
  for (const XrayView& view : views_)
    EXPECT_LT(relative_error(sum_of(bodies, view, poses), sum_of(bodies_, view, poses)), 0.01);
}

}  // namespace
}  // namespace isoshift::bodies_test
