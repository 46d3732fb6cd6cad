#include "registration/similarity/tiles.h"

#include <gtest/gtest.h>

#include <numeric>

#include "registration/preprocess/preprocess.h"
#include "tests/drr/test_views.h"

namespace isoshift::tiles_test {
namespace {

// 20 x 20 pixels; the edge is that of 8 of them.
class TilesTest : public testing::Test {
 protected:
  XrayView view_ = centered_view(0.0, 20, 3.0);
  double edge_mm_ = 8.0 / pixels_per_mm(view_);
};

TEST_F(TilesTest, CoverEveryComparedPixelOnce) {
  std::vector<std::uint32_t> compared(400);
  std::iota(compared.begin(), compared.end(), 0U);
  const std::vector<Tile> tiles = tiles_of(view_, compared, edge_mm_);
  ASSERT_EQ(tiles.size(), 9U);
  std::vector<int> times(400);
  for (const Tile& tile : tiles)
    for (const std::uint32_t n : tile.compared) ++times[n];
  EXPECT_EQ(times, std::vector<int>(400, 1));
  EXPECT_EQ(tiles[0].compared.size(), 64U);
  EXPECT_EQ(tiles[0].covered, 1.0);
  EXPECT_EQ(tiles[1].compared.front(), 8U);  // row after row
  EXPECT_EQ(tiles[8].covered, 0.25);         // of 8 x 8 pixels the image has 4 x 4
}

TEST_F(TilesTest, NumberThePixelsThatAreCompared) {
  const std::vector<std::uint32_t> compared = {3, 19, 20 * 19 + 19};
  const std::vector<Tile> tiles = tiles_of(view_, compared, edge_mm_);
  ASSERT_EQ(tiles.size(), 3U);
  for (std::uint32_t n = 0; n < 3; ++n) EXPECT_EQ(tiles[n].compared, std::vector<std::uint32_t>{n});
  EXPECT_EQ(tiles[0].covered, 1.0 / 64.0);
}

}  // namespace
}  // namespace isoshift::tiles_test
