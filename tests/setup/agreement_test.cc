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

// Of one error 0.5 % lie beyond 2.576 sigma on either side, of six a sixth of that beyond 3.144 (tables of the normal).
TEST(Agreement, SigmasThatManyErrorsHardlyExceedAreMore) {
  EXPECT_NEAR(sigmas_hardly_exceeded(1), 2.576, 1e-3);
  EXPECT_NEAR(sigmas_hardly_exceeded(6), 3.144, 1e-3);
}

// Three patients with the means 0, 1 and 2: t of two degrees of freedom is 4.303, and their standard error 1/sqrt(3).
// Ten differences of each, instead of one, tell no more of the bias.
TEST(Agreement, DifferencesOfAPatientAreNotIndependent) {
  std::vector<double> differences;
  std::vector<std::size_t> patients;
  for (std::size_t n = 0; n < 30; ++n) {
    differences.push_back(static_cast<double>(n % 3));
    patients.push_back(n % 3);
  }
  EXPECT_NEAR(agreement_of(differences, patients).bias_within.value(), 4.303 / std::sqrt(3.0), 1e-3);
  EXPECT_NEAR(agreement_of(differences, patients).bias, 1.0, 1e-12);
  EXPECT_EQ(agreement_of(differences, patients).sd, agreement_of(differences).sd);
  EXPECT_LT(agreement_of(differences).bias_within.value(), 0.4);
  // With one difference per patient both are the same.
  const std::vector<double> once = {0.3, -0.2, 0.9};
  EXPECT_NEAR(agreement_of(once, std::vector<std::size_t>{7, 8, 9}).bias_within.value(),
              agreement_of(once).bias_within.value(), 1e-12);
  EXPECT_FALSE(agreement_of(once, std::vector<std::size_t>{7, 7, 7}).bias_within) << "one patient";
}

}  // namespace
}  // namespace isoshift::agreement_test
