#include "setup/setup_errors.h"

#include <gtest/gtest.h>

#include <cmath>

namespace isoshift::setup_errors_test {
namespace {

// Two patients with two fractions each, worked by hand: x of the first is 1 and 3, of the second -2 and 0.
TEST(SetupErrors, SystematicAndRandomAreThoseOfTheLiterature) {
  const PatientErrors first = errors_of_patient("A", {{1, 0, 0, 0, 0, 0}, {3, 0, 0, 0, 0, 2}});
  const PatientErrors second = errors_of_patient("B", {{-2, 0, 0, 0, 0, 0}, {0, 0, 0, 0, 0, 0}});
  EXPECT_DOUBLE_EQ(first.mean[0], 2.0);
  EXPECT_DOUBLE_EQ((*first.sd)[0], std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(first.mean[5], 1.0);
  const auto population = errors_of_population({first, second});
  ASSERT_TRUE(population);
  EXPECT_EQ(population->patients, 2U);
  EXPECT_DOUBLE_EQ(population->mean[0], 0.5);
  EXPECT_DOUBLE_EQ(population->systematic[0], std::sqrt(2.0 * 1.5 * 1.5));
  EXPECT_DOUBLE_EQ(population->random[0], std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(population->random[5], 1.0);  // of sqrt(2) and 0
}

TEST(SetupErrors, OneFractionHasNoRandomError) {
  const PatientErrors once = errors_of_patient("A", {{1, 2, 3, 0, 0, 0}});
  EXPECT_FALSE(once.sd);
  EXPECT_FALSE(errors_of_population({once, errors_of_patient("B", {{1, 0, 0, 0, 0, 0}, {2, 0, 0, 0, 0, 0}})}));
}

}  // namespace
}  // namespace isoshift::setup_errors_test
