#include "io/report/view_picture.h"

#include <gtest/gtest.h>

#include <cmath>

#include "io/report/canvas.h"

namespace isoshift::view_picture_test {
namespace {

TEST(ViewPicture, DirectionsAreTheStrongestFirst) {
  EXPECT_EQ(orientation_letters({1, 0, 0}), "L");
  EXPECT_EQ(orientation_letters({-0.2, 0, -1}), "F");
  EXPECT_EQ(orientation_letters({-0.6, -0.8, 0}), "AR");
  EXPECT_EQ(orientation_letters({0, 1, 0.5}), "PH");
}

TEST(ViewPicture, GraysAreThoseOfTheXrayForADrrOfAnotherScale) {
  Image<float> xray(20, 20), drr(20, 20);
  for (std::size_t n = 0; n < xray.pixels.size(); ++n) {
    drr.pixels[n] = static_cast<float>(n);
    xray.pixels[n] = 3.0F * drr.pixels[n] + 50.0F;
  }
  ViewPicture picture;
  put_grays(picture, xray, drr, drr, Image<std::uint8_t>(20, 20, 1));
  for (std::size_t n = 0; n < xray.pixels.size(); ++n)
    EXPECT_NEAR(picture.drr_found.pixels[n], picture.xray.pixels[n], 1);
  const auto gray = overlay(picture.xray, picture.drr_found);
  EXPECT_NEAR(gray.at(10, 10)[0], gray.at(10, 10)[1], 1);
}

TEST(ViewPicture, ADrrHasTheGraysOfAnXrayThatWasHardened) {
  Image<float> xray(40, 40), drr(40, 40);
  for (std::size_t n = 0; n < xray.pixels.size(); ++n) {
    drr.pixels[n] = static_cast<float>(n % 800);
    xray.pixels[n] = std::sqrt(drr.pixels[n]);
  }
  Image<std::uint8_t> field(40, 40, 1);
  for (int row = 0; row < 40; ++row) field.at(0, row) = 0;
  for (int row = 0; row < 40; ++row) drr.at(0, row) = 1e6F;  // what is not compared has no say
  const Image<std::uint8_t> picture = GrayScale::of(xray, field)(xray);
  const GrayScale like = GrayScale::like(drr, picture, field);
  const Image<std::uint8_t> alike = like(drr);
  for (int row = 0; row < 40; ++row)
    for (int column = 1; column < 40; ++column) ASSERT_NEAR(alike.at(column, row), picture.at(column, row), 3);
  // Elsewhere a line integral keeps its gray.
  Image<float> moved(2, 1);
  moved.pixels = {drr.at(5, 5), -1e9F};
  EXPECT_EQ(like(moved).at(0, 0), alike.at(5, 5));
  EXPECT_EQ(like(moved).at(1, 0), alike.at(1, 0));
  const Image<std::uint8_t> nothing(40, 40);
  EXPECT_EQ(GrayScale::like(drr, picture, nothing)(drr).pixels.size(), picture.pixels.size());
}

}  // namespace
}  // namespace isoshift::view_picture_test
