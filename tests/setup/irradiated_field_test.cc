// How far within a field a place lies.

#include "setup/irradiated_field.h"

#include <gtest/gtest.h>

namespace isoshift::irradiated_field_test {
namespace {

TEST(IrradiatedFieldSides, APlaceLiesInsideOrOutside) {
  const IrradiatedField field{.corners_px = {{100, 50}, {300, 50}, {300, 450}, {100, 450}}};
  EXPECT_DOUBLE_EQ(inside_px(field, {110, 200}), 10.0);
  EXPECT_DOUBLE_EQ(inside_px(field, {250, 430}), 20.0);
  EXPECT_DOUBLE_EQ(inside_px(field, {80, 200}), -20.0);
  EXPECT_DOUBLE_EQ(inside_px(field, {303, 454}), -5.0) << "beyond a corner";
}

TEST(IrradiatedFieldSides, LeavesMayMakeABay) {
  const IrradiatedField field{
      .corners_px = {{0, 0}, {100, 0}, {100, 40}, {50, 40}, {50, 60}, {100, 60}, {100, 100}, {0, 100}}};
  EXPECT_DOUBLE_EQ(inside_px(field, {70, 50}), -10.0);
  EXPECT_DOUBLE_EQ(inside_px(field, {45, 50}), 5.0);
  EXPECT_DOUBLE_EQ(inside_px(field, {70, 30}), 10.0);
}

}  // namespace
}  // namespace isoshift::irradiated_field_test
