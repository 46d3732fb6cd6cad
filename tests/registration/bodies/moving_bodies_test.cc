// DRRs of bodies that move in small and large steps are those of bodies rendered anew.

#include "registration/bodies/moving_bodies.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/drr/test_views.h"
#include "tests/support/bent_scene.h"

namespace isoshift::moving_bodies_test {
namespace {

using Eigen::Vector3d;

class MovingBodiesTest : public testing::Test {
 protected:
  MovingBodiesTest() { std::iota(pixels_.begin(), pixels_.end(), 0U); }

  std::vector<float> rendered(const std::vector<Eigen::Isometry3d>& poses) const {
    std::vector<float> sum(pixels_.size());
    for (std::size_t body = 0; body < poses.size(); ++body) bodies_.add(body, view_, poses[body], pixels_, sum);
    return sum;
  }

  Volume<float> ct_ = phantom_ct();
  BodyRenderers bodies_{RendererKind::kCpu, ct_, {}, std::array{Beam::kKilovoltage}, slabs(ct_, {-30.0, 15.0}, 16.0)};
  XrayView view_ = centered_view(70.0, 50, 6.0);
  std::vector<std::uint32_t> pixels_ = std::vector<std::uint32_t>(2500);
};

std::vector<float> copy_of(std::span<const float> line_integrals) {
  return {line_integrals.begin(), line_integrals.end()};
}

TEST_F(MovingBodiesTest, FollowSmallAndLargeMotions) {
  MovingBodies moving(bodies_, view_, pixels_);
  const std::vector<Eigen::Isometry3d> start = random_poses(3);
  moving.move_to(start);
  const std::vector<float> at_start = copy_of(moving.line_integrals());
  EXPECT_LT(relative_error(at_start, rendered(start)), 1e-6);
  // The first two are less than a tenth of a pixel, and not rendered anew.
  for (const double far_mm : {0.05, 0.2, 5.0}) {
    std::vector<Eigen::Isometry3d> poses = start;
    poses[1] = Eigen::Translation3d(0.0, far_mm, 0.0) * Eigen::AngleAxisd(far_mm / 500.0, Vector3d::UnitX()) * start[1];
    moving.move_to(poses);
    const std::vector<float> anew = rendered(poses);
    const double change = relative_error(at_start, anew);
    EXPECT_LT(relative_error(copy_of(moving.line_integrals()), anew), 0.2 * change) << far_mm << " mm";
    moving.move_to(start);
    EXPECT_LT(relative_error(copy_of(moving.line_integrals()), at_start), 0.2 * change) << "back from " << far_mm;
  }
}

TEST_F(MovingBodiesTest, DerivativesBetweenPixelsAreThoseOfTheBodyAlone) {
  MovingBodies moving(bodies_, view_, pixels_);
  const std::vector<Eigen::Isometry3d> poses = random_poses(3);
  moving.move_to(poses);
  const BodyDrr part = bodies_.part_with_derivatives(1, view_, poses[1], pixels_);
  std::vector<MotionDerivatives> derivatives(pixels_.size(), MotionDerivatives::Zero());
  for (std::size_t n = 0; n < part.places.size(); ++n) derivatives[part.places[n]] = part.derivatives[n];
  std::size_t covered = 0;
  for (std::uint32_t pixel = 1; pixel < pixels_.size(); ++pixel) {
    EXPECT_EQ(moving.derivatives_between(1, pixel - 1, pixel), derivatives[pixel] - derivatives[pixel - 1]);
    covered += moving.covers(1, pixel) ? 1 : 0;
  }
  EXPECT_GT(covered, 100U);
  EXPECT_LT(covered, pixels_.size() / 2);  // a slab of the CT
}

}  // namespace
}  // namespace isoshift::moving_bodies_test
