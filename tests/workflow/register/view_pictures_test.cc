// Arrows show how bones moved, where the view can see it.

#include "workflow/register/view_pictures.h"

#include <gtest/gtest.h>

#include "tests/drr/test_views.h"

namespace isoshift::view_pictures_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

BodyMotion bone(const Vector3d& center_mm, const Vector3d& displacement_mm) {
  return {.name = "bone",
          .center_room_mm = center_mm,
          .displacement_mm = displacement_mm,
          .sigma_mm = Vector3d::Constant(0.2),
          .image_share = 0.9};
}

TEST(MotionArrows, PointWhereBonesLieFiveTimesAsLong) {
  const XrayView view = centered_view(0.0, 200, 1.5);  // a pixel is 1 mm at the isocenter
  const Eigen::Isometry3d setup_error(Eigen::Translation3d(3.0, 5.0, 0.0));
  const Vector3d center(10.0, 40.0, 0.0), motion(-2.0, 4.0, 0.0);
  const std::vector<Polygon> arrows = motion_arrows(view, std::vector{bone(center, motion)}, setup_error);
  ASSERT_EQ(arrows.size(), 1U);
  const Vector2d tip = arrows[0][1], from = arrows[0][2];
  EXPECT_LT((from - *view.project(setup_error * center)).norm(), 1e-9);
  const Vector2d once = *view.project(setup_error * (center + motion)) - from;
  EXPECT_LT((tip - from - kMotionMagnified * once).norm(), 1e-6);
  EXPECT_NEAR((tip - from).norm(), kMotionMagnified * motion.norm(), 1e-6);
  // The head lies behind its tip.
  for (const std::size_t corner : {std::size_t{0}, std::size_t{4}})
    EXPECT_LT((arrows[0][corner] - tip).dot(tip - from), 0.0);
}

TEST(MotionArrows, AreOnlyOfWhatIsKnownAndSeen) {
  const XrayView view = centered_view(0.0, 200, 1.5);
  const Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  const auto count = [&](const BodyMotion& body) { return motion_arrows(view, std::vector{body}, setup_error).size(); };
  EXPECT_EQ(count(bone({10, 0, 0}, {0, 4, 0})), 1U);
  EXPECT_EQ(count(bone({10, 0, 0}, {0, 0.5, 0})), 0U) << "hardly moved";
  EXPECT_EQ(count(bone({0, 0, 0}, {0, 0, 4})), 0U) << "toward the source";
  BodyMotion breathing = bone({10, 0, 0}, {0, 4, 0}), springs = breathing;
  breathing.breathes = true;
  EXPECT_EQ(count(breathing), 0U);
  springs.image_share = 0.0;
  EXPECT_EQ(count(springs), 0U);
}

}  // namespace
}  // namespace isoshift::view_pictures_test
