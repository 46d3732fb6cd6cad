#include "setup/agreement.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace isoshift::agreement_test {
namespace {

// t of 4 degrees of freedom at 97.5 % is 2.776 (any table of Student's t).
TEST(Agreement, IsBiasSpreadAndTheirBounds) {
  const std::array differences = {1.0, 2.0, 3.0, 4.0, 5.0};
  const Agreement agreement = agreement_of(differences);
  EXPECT_EQ(agreement.count, 5U);
  EXPECT_DOUBLE_EQ(agreement.bias, 3.0);
  EXPECT_DOUBLE_EQ(agreement.sd.value(), std::sqrt(2.5));
  EXPECT_NEAR(agreement.bias_within.value(), 2.776 * std::sqrt(2.5 / 5.0), 1e-3);
  EXPECT_DOUBLE_EQ(agreement.limit.value(), 1.96 * std::sqrt(2.5));
}

TEST(Agreement, OfOneDifferenceHasNoSpread) {
  const std::array once = {0.5};
  const Agreement agreement = agreement_of(once);
  EXPECT_DOUBLE_EQ(agreement.bias, 0.5);
  EXPECT_FALSE(agreement.sd || agreement.bias_within || agreement.limit);
}

// Bounds of 0 of 10, 7 of 20 and 95 of 100, computed by the incomplete beta function of another program.
TEST(Agreement, SharesHaveTheirExactBounds) {
  EXPECT_EQ(share_of(0, 10).low, 0.0);
  EXPECT_NEAR(share_of(0, 10).high, 0.3085, 1e-4);
  EXPECT_NEAR(share_of(7, 20).low, 0.1539, 1e-4);
  EXPECT_NEAR(share_of(7, 20).high, 0.5922, 1e-4);
  EXPECT_NEAR(share_of(95, 100).low, 0.8872, 1e-4);
  EXPECT_NEAR(share_of(95, 100).high, 0.9836, 1e-4);
  EXPECT_EQ(share_of(3, 3).high, 1.0);
}

}  // namespace
}  // namespace isoshift::agreement_test
