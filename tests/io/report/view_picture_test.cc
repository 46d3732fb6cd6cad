#include "io/report/view_picture.h"

#include <gtest/gtest.h>

#include "io/report/canvas.h"

namespace isoshift {
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

}  // namespace
}  // namespace isoshift
