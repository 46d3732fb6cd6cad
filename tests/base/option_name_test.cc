#include "base/option_name.h"

#include <gtest/gtest.h>

namespace isoshift::option_name_test {
namespace {

TEST(OptionName, IsThatOfAnArgumentOrOfAFlag) {
  EXPECT_EQ(option("couch-angle", "DEG"), "--couch-angle DEG");  // the style of this program
  EXPECT_EQ(option("assume-centered"), "--assume-centered");
  name_options(OptionStyle::kNamed);
  EXPECT_EQ(option("couch-angle", "DEG"), "couch_angle_deg");
  EXPECT_EQ(option("isocenter", "X,Y,Z"), "isocenter=X,Y,Z");
  EXPECT_EQ(option("assume-centered"), "assume_centered");
  EXPECT_EQ(option("sid", "1500"), "sid_mm=1500");
  EXPECT_EQ(option("image", "FILE"), "images=FILE");
  name_options(OptionStyle::kFlags);
}

}  // namespace
}  // namespace isoshift::option_name_test
