#include "workflow/audit_setup/drift.h"

#include <gtest/gtest.h>

#include <random>

namespace isoshift::drift_test {
namespace {

// Ten sessions of ten patients, a day apart.
std::vector<Measurement> daily(const std::vector<double>& values) {
  std::vector<Measurement> all;
  for (std::size_t n = 0; n < values.size(); ++n)
    all.push_back({.day = 100.0 + static_cast<double>(n), .patient = n, .value = values[n]});
  return all;
}

// Worked by hand: 0.5 a day, and alternately 0.1 more and less, which takes 0.5/82.5 from the slope and leaves the sum
// of squares 0.1 - 0.25/82.5. t of 8 degrees of freedom at 97.5 % is 2.306.
TEST(Drift, OfSinglePatientsIsOrdinaryLeastSquares) {
  const auto drift = drift_of(daily({0.1, 0.4, 1.1, 1.4, 2.1, 2.4, 3.1, 3.4, 4.1, 4.4}), 1);
  ASSERT_TRUE(drift);
  const double slope = 0.5 - 0.5 / 82.5;
  const double left = 0.1 - 0.5 * 0.5 / 82.5, error = std::sqrt(left / 8.0 / 82.5);
  EXPECT_NEAR(drift->slope, 30.0 * slope, 1e-9);
  EXPECT_NEAR(drift->slope_within, 30.0 * 2.306 * error, 1e-3);
  EXPECT_EQ(drift->shape, DriftShape::kLine);
  EXPECT_TRUE(drift->is_significant());
  EXPECT_NEAR(drift->at(104.5), 2.25, 1e-9) << "the mean";
}

TEST(Drift, AStepIsFoundOnItsDay) {
  std::vector<double> values;
  for (int n = 0; n < 40; ++n) values.push_back((n < 27 ? 0.0 : 2.0) + (n % 3 == 0 ? 0.2 : -0.1));
  const auto drift = drift_of(daily(values), 6);
  ASSERT_TRUE(drift);
  EXPECT_TRUE(drift->is_significant());
  EXPECT_EQ(drift->shape, DriftShape::kStep);
  EXPECT_EQ(drift->begins, 127.0);
  EXPECT_NEAR(drift->change, 2.0, 0.1);
  EXPECT_NEAR(drift->at(126.0), 0.0, 0.1);
  EXPECT_NEAR(drift->at(127.0), 2.0, 0.1);
}

// As the rotations of sessions that were registered by translations alone; the mean of 0.7 is not 0.7 to the last bit.
TEST(Drift, ValuesThatAreAllAlikeDoNotDrift) {
  for (const double value : {0.0, 0.7, -1.6}) {
    std::vector<Measurement> sessions = daily(std::vector<double>(30, value));
    for (Measurement& one : sessions) one.patient /= 3;
    const auto drift = drift_of(sessions, 6);
    ASSERT_TRUE(drift);
    EXPECT_FALSE(drift->is_significant()) << value;
    EXPECT_NEAR(drift->change, 0.0, 1e-9);
    EXPECT_LT(drift->slope_within, 0.01);
  }
}

TEST(Drift, IsNotLookedForInFewSessionsOrPatients) {
  EXPECT_FALSE(drift_of(daily({1, 2, 3, 4, 5, 6, 7, 8, 9}), 1)) << "nine sessions";
  std::vector<Measurement> of_two = daily({1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
  for (Measurement& one : of_two) one.patient %= 2;
  EXPECT_FALSE(drift_of(of_two, 1));
  std::vector<Measurement> at_once = daily({1, 2, 3, 4, 5, 6, 7, 8, 9, 10});
  for (Measurement& one : at_once) one.day = 1.0;
  EXPECT_FALSE(drift_of(at_once, 1));
}

// How many of `series` series of 60 sessions of 8 patients, who come one after the other, are called. Patients differ
// by `patients_differ`, sessions by 1.
int called(int series, double patients_differ, double change_in_all) {
  std::mt19937_64 generator(7);
  std::normal_distribution<double> normal;
  int count = 0;
  for (int n = 0; n < series; ++n) {
    std::vector<Measurement> all;
    double of_patient = 0.0;
    for (std::size_t session = 0; session < 60; ++session) {
      const std::size_t patient = session * 8 / 60;
      if (all.empty() || all.back().patient != patient) of_patient = patients_differ * normal(generator);
      all.push_back({.day = 5.0 * static_cast<double>(session),
                     .patient = patient,
                     .value = of_patient + normal(generator) + change_in_all * static_cast<double>(session) / 59.0});
    }
    const auto drift = drift_of(all, 1);
    count += drift && drift->is_significant() ? 1 : 0;
  }
  return count;
}

// 5 % of 1000 are 50; a binomial count goes beyond 71 in one of a thousand programs.
TEST(Drift, IsRarelyCalledWhereNothingChanges) {
  for (const double patients_differ : {0.0, 0.5, 1.0, 3.0})
    EXPECT_LE(called(1000, patients_differ, 0.0), 71) << patients_differ;
}

TEST(Drift, IsCalledWhereItIsLargeAgainstSessionsAndPatients) {
  EXPECT_GE(called(200, 0.0, 4.0), 198);
  EXPECT_GE(called(200, 0.3, 5.0), 190);
}

}  // namespace
}  // namespace isoshift::drift_test
