#include "geometry/seen_motions.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/gantry_view.h"

namespace isoshift::seen_motions_test {
namespace {

// The source stands at the top, 1000 mm from the isocenter: it sees x and y of the isocenter as they are, and not z.
// What lies 50 mm nearer to it looks 1000 / 950 times as large; a turn about x moves it along y.
TEST(SeenMotions, AreThoseOfAPerspective) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {0, 0, 50}};
  const SeenMotions seen = seen_motions(view_from_gantry(0.0), points);
  ASSERT_EQ(seen.rows(), 4);
  constexpr double kPixelsPerMm = kGantryViewSidMm / 1000.0 / kGantryViewPixelMm;
  EXPECT_NEAR(std::abs(seen(0, 0)), kPixelsPerMm, 1e-4);
  EXPECT_NEAR(std::abs(seen(1, 1)), kPixelsPerMm, 1e-4);
  EXPECT_NEAR(seen.block(0, 2, 2, 4).norm(), 0.0, 1e-4) << "neither z nor turns move the isocenter";
  EXPECT_NEAR(seen(2, 0) / seen(0, 0), 1000.0 / 950.0, 1e-4);
  EXPECT_NEAR(seen(3, 3) / seen(3, 1), -50.0, 1e-3);
  EXPECT_NEAR(seen(2, 4) / seen(2, 0), 50.0, 1e-3);
}

TEST(SeenMotions, OfPointsBehindTheSourceAreNothing) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 1200}};
  EXPECT_TRUE(seen_motions(view_from_gantry(0.0), points).isZero());
}

}  // namespace
}  // namespace isoshift::seen_motions_test
