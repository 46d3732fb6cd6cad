#include "registration/preprocess/image_operations.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/support/pose_near.h"

namespace isoshift::image_operations_test {
namespace {

// Round blobs, bright and dark, that no shift of some pixels leaves alike.
double pattern(double column, double row) {
  double sum = 0.0;
  for (int n = 0; n < 60; ++n) {
    const double x = std::fmod(37.7 * n, 90.0) - 13.0, y = std::fmod(23.3 * n + 0.9 * n * n, 90.0) - 13.0;
    sum += (n % 2 == 0 ? 1.0 : -0.8) * std::exp(-(std::pow(column - x, 2) + std::pow(row - y, 2)) / (2.0 * 9.0));
  }
  return sum;
}

Image<float> pattern_moved_by(double columns, double rows, int size = 64) {
  Image<float> image(size, size);
  for (int row = 0; row < size; ++row)
    for (int column = 0; column < size; ++column)
      image.at(column, row) = static_cast<float>(pattern(column - columns, row - rows));
  return image;
}

Image<std::uint8_t> whole() { return {64, 64, 1}; }

TEST(ImageOperations, BestMatchFindsAShiftToAFractionOfAPixel) {
  const PixelSquare square{.column = 20, .row = 24, .edge = 16};
  for (const Eigen::Vector2d& moved :
       std::array<Eigen::Vector2d, 5>{{{0, 0}, {3, -2}, {2.3, -1.6}, {-5.5, 4.25}, {-0.2, 0.4}}}) {
    const SquareMatch match =
        best_match(pattern_moved_by(0, 0), whole(), square, pattern_moved_by(moved.x(), moved.y()), /*reach_px=*/8);
    // The parabola through three values is not quite the top of a correlation.
    EXPECT_THAT(match.displacement_px, VectorNear(moved, 0.1)) << moved.transpose();
    EXPECT_GT(match.correlation_there, 0.98);
    EXPECT_GE(match.correlation_there, match.correlation_here - 1e-6);
    if (moved.norm() == 0.0) {
      EXPECT_NEAR(match.correlation_here, 1.0, 1e-5);
    }
    if (moved.norm() > 3.0) {
      EXPECT_LT(match.correlation_here, 0.9);
    }
  }
}

TEST(ImageOperations, BestMatchIsBlindToBrightnessAndContrast) {
  Image<float> other = pattern_moved_by(2, 1);
  for (float& pixel : other.pixels) pixel = 100.0F + 7.0F * pixel;
  const SquareMatch match =
      best_match(pattern_moved_by(0, 0), whole(), {.column = 20, .row = 24, .edge = 16}, other, 6);
  EXPECT_THAT(match.displacement_px, VectorNear(Eigen::Vector2d(2, 1), 0.1));
  EXPECT_NEAR(match.correlation_there, 1.0, 1e-4);
}

TEST(ImageOperations, BestMatchSearchesNoFurtherThanItsReachAndTheImage) {
  const Image<float> image = pattern_moved_by(0, 0);
  const SquareMatch within =
      best_match(image, whole(), {.column = 20, .row = 24, .edge = 16}, pattern_moved_by(9, 0), 4);
  EXPECT_LE(within.displacement_px.cwiseAbs().maxCoeff(), 4.0);
  // In the corners, half of the search lies outside.
  for (const auto& [column, row] : {std::pair(0, 0), {48, 0}, {0, 48}, {48, 48}}) {
    const double toward_x = column == 0 ? 2.0 : -2.0, toward_y = row == 0 ? 3.0 : -3.0;
    const SquareMatch match =
        best_match(image, whole(), {.column = column, .row = row, .edge = 16}, pattern_moved_by(toward_x, toward_y), 6);
    EXPECT_THAT(match.displacement_px, VectorNear(Eigen::Vector2d(toward_x, toward_y), 0.1)) << column << ", " << row;
  }
}

TEST(ImageOperations, BestMatchLooksOnlyInsideTheMask) {
  const PixelSquare square{.column = 20, .row = 24, .edge = 16};
  Image<float> disturbed = pattern_moved_by(0, 0);
  Image<std::uint8_t> mask = whole();
  for (int row = 24; row < 40; ++row)
    for (int column = 20; column < 24; ++column) {
      disturbed.at(column, row) += static_cast<float>(10 * ((column + row) % 2));
      mask.at(column, row) = 0;
    }
  const Image<float> moved = pattern_moved_by(3, -2);
  EXPECT_LT(best_match(disturbed, whole(), square, moved, 6).correlation_there, 0.5);
  const SquareMatch match = best_match(disturbed, mask, square, moved, 6);
  EXPECT_THAT(match.displacement_px, VectorNear(Eigen::Vector2d(3, -2), 0.15));  // less to see, a broader top
  EXPECT_NEAR(match.correlation_there, 1.0, 1e-4);
  // Where the other image is constant, nothing matches.
  const SquareMatch none = best_match(disturbed, mask, square, Image<float>(64, 64, 0.3F), 6);
  EXPECT_LT(none.correlation_there, 0.5);
  EXPECT_LT(none.correlation_here, 0.5);
}

TEST(ImageOperations, AMaskGrowsByADisc) {
  Image<std::uint8_t> mask(21, 17, 0);
  mask.at(8, 9) = 1;
  EXPECT_EQ(grown(mask, 0).pixels, mask.pixels);
  for (const int radius : {1, 4}) {
    const Image<std::uint8_t> result = grown(mask, radius);
    for (int row = 0; row < mask.rows; ++row)
      for (int column = 0; column < mask.columns; ++column) {
        const double distance = std::hypot(column - 8, row - 9);
        // Between the circle and half a pixel beyond it, a disc of pixels may be rounded either way.
        if (distance > radius - 0.5 && distance < radius + 0.75 && (column != 8 && row != 9)) continue;
        EXPECT_EQ(result.at(column, row) != 0, distance <= radius) << column << ", " << row;
      }
  }
  mask.at(0, 0) = 1;
  EXPECT_NE(grown(mask, 2).at(2, 0), 0);  // at the border, too
}

TEST(ImageOperations, HighPassLeavesOutWhatIsSlow) {
  const Image<float> constant(40, 30, 5.0F);
  for (const float pixel : high_pass(constant, 6.0).pixels) ASSERT_NEAR(pixel, 0.0, 1e-5);
  // Far from the borders a ramp is its own mean, and a single pixel stays but for the little that it adds to the mean.
  Image<float> ramp(80, 80);
  for (int row = 0; row < 80; ++row)
    for (int column = 0; column < 80; ++column) ramp.at(column, row) = static_cast<float>(0.1 * column - 0.2 * row);
  ramp.at(40, 40) += 1.0F;
  const Image<float> fast = high_pass(ramp, 5.0);
  EXPECT_NEAR(fast.at(25, 30), 0.0, 1e-4);
  EXPECT_NEAR(fast.at(40, 40), 1.0 - 1.0 / (2.0 * M_PI * 25.0), 1e-3);
}

TEST(ImageOperations, ShareInsideCountsTheSquaresPixels) {
  Image<std::uint8_t> mask(10, 10, 0);
  for (int row = 0; row < 10; ++row)
    for (int column = 4; column < 10; ++column) mask.at(column, row) = 1;
  EXPECT_EQ(share_inside(mask, {.column = 4, .row = 2, .edge = 4}), 1.0);
  EXPECT_EQ(share_inside(mask, {.column = 0, .row = 2, .edge = 4}), 0.0);
  EXPECT_EQ(share_inside(mask, {.column = 3, .row = 2, .edge = 4}), 0.75);
}

// A square of open field, where the receptor is saturated, says nothing.
TEST(ImageOperations, AConstantSquareMatchesNowhere) {
  const Image<float> constant(64, 64, 0.0F);
  const SquareMatch match =
      best_match(constant, whole(), {.column = 20, .row = 24, .edge = 16}, pattern_moved_by(0, 0), 6);
  EXPECT_LT(match.correlation_there, 0.5);
  EXPECT_LT(match.correlation_here, 0.5);
}

}  // namespace
}  // namespace isoshift::image_operations_test
