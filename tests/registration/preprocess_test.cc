#include "registration/preprocess/preprocess.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/rotation.h"
#include "tests/drr/test_views.h"

namespace isoshift::preprocess_test {
namespace {

constexpr int kPixels = 200;  // of 2 mm on the panel: 1.33 mm at the isocenter

// An open field, not quite even, around a disc of absorber, and 3 % of the intensity outside `inside`.
template <class Inside>
XrayImage collimated(Inside inside, double unevenness = 1e-5) {
  XrayImage xray;
  xray.view = centered_view(0, kPixels, 2.0);
  xray.values = Image<float>(kPixels, kPixels);
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      const double absorbed = std::hypot(column - 99.5, row - 99.5) < 30 ? std::exp(-2.0) : 1.0;
      xray.values.at(column, row) = static_cast<float>(1000.0 * absorbed * (inside(column, row) ? 1.0 : 0.03) *
                                                       (1.0 - unevenness * (column + 0.3 * row)));
    }
  return xray;
}

TEST(Preprocess, LineIntegralsAreTheLogarithmOfTheIntensity) {
  XrayImage xray = collimated([](int, int) { return true; }, 0.0);
  const Image<float> line_integral = line_integrals(xray);
  EXPECT_NEAR(line_integral.at(5, 5), 0.0, 1e-6);
  EXPECT_NEAR(line_integral.at(100, 100), 2.0, 1e-5);
  xray.meaning = XrayImage::Meaning::kLineIntegral;
  EXPECT_EQ(line_integrals(xray).pixels, xray.values.pixels);
}

TEST(Preprocess, OpenFieldReachesToTheRim) {
  const FixedImage image = prepare(collimated([](int, int) { return true; }));
  EXPECT_EQ(image.field.at(100, 100), 1);
  EXPECT_EQ(image.field.at(4, 100), 1);
  EXPECT_EQ(image.field.at(0, 100), 0);  // the rim, 2 mm at the isocenter
}

TEST(Preprocess, CollimatedFieldIsFoundOnAllSides) {
  const FixedImage image = prepare(collimated([](int c, int r) { return c >= 40 && c < 150 && r >= 60 && r < 170; }));
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      // Within three pixels of the edge the mask may go either way.
      const bool well_inside = column >= 43 && column < 147 && row >= 63 && row < 167;
      const bool outside = column < 40 || column >= 150 || row < 60 || row >= 170;
      if (well_inside || outside) {
        ASSERT_EQ(image.field.at(column, row), well_inside) << column << ", " << row;
      }
    }
}

TEST(Preprocess, FieldMayBeTurnedByTheCollimator) {
  const double angle_rad = rad_from_deg(20.0);
  // Collimator angles count counter-clockwise seen from the source, that is in the image as displayed.
  const auto inside = [&](int column, int row) {
    const double x = column - 99.5, y = -(row - 99.5);
    const double along = std::cos(angle_rad) * x + std::sin(angle_rad) * y;
    const double across = -std::sin(angle_rad) * x + std::cos(angle_rad) * y;
    return std::abs(along) < 60 && std::abs(across) < 45;
  };
  XrayImage xray = collimated(inside);
  xray.collimator_angle_rad = angle_rad;
  const FixedImage image = prepare(xray);
  int wrong = 0, in_field = 0;
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      in_field += image.field.at(column, row);
      wrong += image.field.at(column, row) && !inside(column, row);
    }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(in_field, 0.85 * 120 * 90);
}

// A saturated receptor, or a display window: what was cut off is not known. A few pixels at an extreme are just that.
TEST(Preprocess, WhatIsCutOffIsLeftOutOfTheField) {
  XrayImage xray = collimated([](int, int) { return true; });
  const FixedImage whole = prepare(xray);
  EXPECT_EQ(whole.field.at(150, 100), 1);
  EXPECT_EQ(whole.field.at(100, 100), 1);
  XrayImage saturated = xray, windowed = xray;
  for (float& value : saturated.values.pixels) value = std::min(value, 500.0F);
  for (float& value : windowed.values.pixels) value = std::max(value, 500.0F);
  EXPECT_EQ(prepare(saturated).field.at(150, 100), 0);
  EXPECT_EQ(prepare(saturated).field.at(100, 100), 1);
  EXPECT_EQ(prepare(windowed).field.at(150, 100), 1);
  EXPECT_EQ(prepare(windowed).field.at(100, 100), 0);
}

// A plate as bright as nothing else has four straight edges, as a field has. It ended in "only 0 pixels".
TEST(Preprocess, ASaturatedPlateIsNotTheField) {
  XrayImage xray = collimated([](int, int) { return true; });
  for (int row = 120; row < 150; ++row)
    for (int column = 40; column < 76; ++column) xray.values.at(column, row) = 65535.0F;
  const FixedImage image = prepare(xray);
  EXPECT_FALSE(image.irradiated.is_sure());
  EXPECT_EQ(image.field.at(100, 100), 1);
  EXPECT_EQ(image.field.at(150, 60), 1);
  EXPECT_EQ(image.field.at(60, 135), 0);
}

TEST(Preprocess, SinglePixelsAtTheEndOfTheRangeAreNoise) {
  XrayImage xray = collimated([](int, int) { return true; });
  for (int row = 40; row < 160; row += 3)
    for (int column = 40; column < 160; column += 2) xray.values.at(column, row) = 2000.0F;
  const FixedImage image = prepare(xray);
  for (int row = 40; row < 160; ++row)
    for (int column = 40; column < 160; ++column) ASSERT_EQ(image.field.at(column, row), 1) << column << " " << row;
}

TEST(Preprocess, ReducedImagesAverageAndKeepTheField) {
  FixedImage image = prepare(collimated([](int, int) { return true; }));
  const FixedImage half = reduced(image, 2);
  EXPECT_EQ(half.view.columns, 100);
  const float mean = (image.line_integral.at(80, 84) + image.line_integral.at(81, 84) + image.line_integral.at(80, 85) +
                      image.line_integral.at(81, 85)) /
                     4.0F;
  EXPECT_FLOAT_EQ(half.line_integral.at(40, 42), mean);
  EXPECT_EQ(half.field.at(0, 42), 0);
  EXPECT_EQ(half.field.at(40, 42), 1);
}

TEST(Preprocess, ARectangleLimitsTheFieldAndIncludesItsBounds) {
  FixedImage image = prepare(collimated([](int, int) { return true; }));
  const FixedImage whole = image;
  restrict_to({.first_column = 20, .first_row = 30, .last_column = 59, .last_row = 100}, image);
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      const bool inside = column >= 20 && column <= 59 && row >= 30 && row <= 100;
      ASSERT_EQ(image.field.at(column, row), inside ? whole.field.at(column, row) : 0) << column << ", " << row;
    }
  // What was not in the field is not added to it.
  restrict_to({.first_column = 0, .first_row = 0, .last_column = 199, .last_row = 199}, image);
  EXPECT_EQ(image.field.at(0, 0), 0);
  EXPECT_EQ(image.field.at(100, 50), 0);
}

}  // namespace
}  // namespace isoshift::preprocess_test
