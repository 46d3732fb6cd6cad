#include "registration/motion/predictor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "base/error.h"
#include "registration/motion/kalman.h"
#include "registration/motion/periodic_model.h"
#include "registration/motion/rls.h"
#include "registration/motion/score.h"
#include "tests/support/pose_near.h"

namespace isoshift::predictor_test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

VectorXd one(double value) { return VectorXd::Constant(1, value); }
MatrixXd variance(double value, int dimension = 1) { return value * MatrixXd::Identity(dimension, dimension); }

// Breathing: a flat end of expiration, another depth along each axis.
VectorXd breathing(double time_s, double period_s = 4.0) {
  const double c = std::cos(std::numbers::pi * time_s / period_s);
  const double inhaled = 1.0 - c * c * c * c;
  return Eigen::Vector3d(1.5 * inhaled, 8.0 * inhaled,
                         -3.0 * inhaled + 0.5 * std::sin(2 * std::numbers::pi * time_s / period_s));
}

// The 3D error of a predictor on a motion seen at irregular moments, RMS after the first minute.
double rms_error_mm(Predictor& predictor, double latency_s, const std::function<VectorXd(double)>& motion,
                    double noise_mm) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0.0, noise_mm);
  std::uniform_real_distribution<double> jitter(0.06, 0.14);
  double squares = 0.0;
  int count = 0;
  for (double time_s = 0.0; time_s < 150.0; time_s += jitter(random)) {
    VectorXd seen = motion(time_s);
    for (double& value : seen) value += noise(random);
    predictor.add(time_s, seen, variance(std::max(1e-4, noise_mm * noise_mm), static_cast<int>(seen.size())));
    if (time_s < 60.0) continue;
    squares += (predictor.predict(time_s + latency_s).position_mm - motion(time_s + latency_s)).squaredNorm();
    ++count;
  }
  return std::sqrt(squares / count);
}

TEST(Predictor, HoldLastHolds) {
  const auto predictor = make_predictor(PredictorKind::kHoldLast, {});
  predictor->add(0.0, one(1.0), variance(1.0));
  predictor->add(0.3, one(2.0), variance(1.0));
  EXPECT_EQ(predictor->predict(7.0).position_mm, one(2.0));
}

TEST(Predictor, MeasurementsThatMakeNoSenseAreRefused) {
  for (const PredictorKind kind : kPredictorKinds) {
    const auto predictor = make_predictor(kind, {});
    predictor->add(1.0, one(1.0), variance(1.0));
    EXPECT_THROW(predictor->add(1.0, one(1.0), variance(1.0)), UsageError);
    EXPECT_THROW(predictor->add(2.0, VectorXd::Zero(2), variance(1.0, 2)), UsageError);
    EXPECT_THROW(predictor->add(2.0, one(NAN), variance(1.0)), UsageError);
    EXPECT_EQ(predictor_kind_from(to_string(kind)), kind);
  }
}

// The covariance after a measurement settles where the algebraic Riccati equation of the model says:
// P = M - M h (h' M h + r)^-1 h' M with M = F P F' + Q, written out here for one axis.
TEST(ConstantVelocityKalman, SettlesAtTheRiccatiSolution) {
  constexpr double kDt = 0.2, kNoise = 50.0, kVariance = 0.09;
  ConstantVelocityKalman filter({.acceleration_noise = kNoise});
  for (int n = 0; n < 400; ++n) filter.add(n * kDt, one(3.0 * n * kDt), variance(kVariance));
  const Eigen::Matrix2d p = filter.covariance();
  const double q11 = kNoise * kDt * kDt * kDt / 3, q12 = kNoise * kDt * kDt / 2, q22 = kNoise * kDt;
  const double m11 = p(0, 0) + 2 * kDt * p(0, 1) + kDt * kDt * p(1, 1) + q11, m12 = p(0, 1) + kDt * p(1, 1) + q12,
               m22 = p(1, 1) + q22;
  const double s = m11 + kVariance;
  EXPECT_NEAR(p(0, 0), m11 - m11 * m11 / s, 1e-10);
  EXPECT_NEAR(p(0, 1), m12 - m11 * m12 / s, 1e-9);
  EXPECT_NEAR(p(1, 1), m22 - m12 * m12 / s, 1e-8);
  // A straight track is predicted exactly.
  EXPECT_NEAR(filter.predict(400 * kDt).position_mm[0], 3.0 * 400 * kDt, 1e-6);
}

// On tracks made by its own model, errors are as large as it says.
TEST(ConstantVelocityKalman, ItsSigmaIsThatOfItsErrors) {
  constexpr double kDt = 0.1, kNoise = 40.0, kSigma = 0.3, kLatency = 0.3;
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  double squares = 0.0;
  int count = 0;
  for (int track = 0; track < 40; ++track) {
    ConstantVelocityKalman filter({.acceleration_noise = kNoise});
    double position = 0.0, velocity = 5.0 * normal(random);
    const auto advance = [&](double dt) {  // finely: white acceleration
      for (int n = 0; n < 20; ++n) {
        position += velocity * dt / 20;
        velocity += std::sqrt(kNoise * dt / 20) * normal(random);
      }
    };
    for (int n = 0; n < 60; ++n) {
      filter.add(n * kDt, one(position + kSigma * normal(random)), variance(kSigma * kSigma));
      advance(kDt);
    }
    const Prediction prediction = filter.predict(59 * kDt + kLatency);
    advance(kLatency - kDt);
    squares += std::pow((prediction.position_mm[0] - position) / prediction.sigma_mm.value()[0], 2);
    ++count;
  }
  EXPECT_NEAR(squares / count, 1.0, 0.45);  // 2 standard deviations of the mean of 40 squares
}

// One imager: the axis along the rays is not seen. It is carried on, and the filter says how uncertain it becomes.
TEST(ConstantVelocityKalman, AnUnseenAxisIsCarriedWithGrowingUncertainty) {
  ConstantVelocityKalman filter({.acceleration_noise = 10.0});
  MatrixXd unseen = variance(0.01, 2);
  unseen(1, 1) = 1e8;
  for (int n = 0; n < 20; ++n) filter.add(0.2 * n, Eigen::Vector2d(n, 2 * n), variance(0.01, 2));
  double before = filter.predict(3.8).sigma_mm.value()[1];
  for (int n = 20; n < 30; ++n) {
    filter.add(0.2 * n, Eigen::Vector2d(n, -100), unseen);
    const Prediction now = filter.predict(0.2 * n);
    EXPECT_NEAR(now.position_mm[0], n, 0.1);
    EXPECT_NEAR(now.position_mm[1], 2 * n, 1.5);
    EXPECT_GT(now.sigma_mm.value()[1], before);
    before = now.sigma_mm.value()[1];
  }
  EXPECT_GT(before, 2.0);
}

// x[k+1] = 1.6 x[k] - 0.8 x[k-1] + noise: the weights of the two taps.
TEST(RecursiveLeastSquares, RecoversAnAutoregressiveProcess) {
  RecursiveLeastSquares filter({.latency_s = 0.1, .taps = 2, .tap_s = 0.1, .forgetting = 1.0, .regularization = 1e-6});
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0.0, 1.0);
  double now = 1.0, before = 0.0;
  for (int n = 0; n < 20000; ++n) {
    filter.add(0.1 * n, one(now), variance(1.0));
    const double next = 1.6 * now - 0.8 * before + noise(random);
    before = now;
    now = next;
  }
  EXPECT_NEAR(filter.weights()(0, 0), 1.6, 0.02);
  EXPECT_NEAR(filter.weights()(1, 0), -0.8, 0.02);
}

TEST(RecursiveLeastSquares, SaysHoldLastUntilItIsWarm) {
  RecursiveLeastSquares filter({.latency_s = 0.3, .taps = 3});
  for (int n = 0; n < 5; ++n) filter.add(0.1 * n, one(n), variance(1.0));
  EXPECT_FALSE(filter.is_warm());
  EXPECT_EQ(filter.predict(0.7).position_mm[0], 4.0);
}

// An hour of a target that hardly moves, then breathing again: nothing has wound up.
TEST(RecursiveLeastSquares, DoesNotWindUpOnATargetThatRests) {
  RecursiveLeastSquares filter({.latency_s = 0.4});
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 1e-6);
  for (int n = 0; n < 18000; ++n) {
    filter.add(0.2 * n, Eigen::Vector3d(noise(random), noise(random), noise(random)), variance(0.01, 3));
    ASSERT_LT(filter.predict(0.2 * n + 0.4).position_mm.norm(), 1e-4) << n;
  }
  for (int n = 18000; n < 18020; ++n) {
    filter.add(0.2 * n, breathing(0.2 * (n - 18000)), variance(0.01, 3));
    ASSERT_LT(filter.predict(0.2 * n + 0.4).position_mm.norm(), 40.0) << n;
  }
}

TEST(Predictor, FiltersBeatHoldLastOnBreathingSeenAtIrregularMoments) {
  for (const double latency_s : {0.2, 0.4}) {
    const auto error_of = [&](PredictorKind kind) {
      const auto predictor = make_predictor(kind, {.latency_s = latency_s});
      const double error = rms_error_mm(*predictor, latency_s, [](double t) { return breathing(t); }, 0.1);
      EXPECT_TRUE(predictor->is_warm()) << to_string(kind);
      return error;
    };
    const double hold = error_of(PredictorKind::kHoldLast);
    EXPECT_LT(error_of(PredictorKind::kKalman), 0.9 * hold) << latency_s;
    EXPECT_LT(error_of(PredictorKind::kRls), 0.35 * hold) << latency_s;
    EXPECT_LT(error_of(PredictorKind::kModel), 0.35 * hold) << latency_s;
  }
}

TEST(PeriodicTrajectory, IsThatOfItsPhases) {
  std::vector<VectorXd> phases;
  for (int n = 0; n < 10; ++n) phases.push_back(one(5.0 * std::sin(2 * std::numbers::pi * n / 10) + 7.0));
  const PeriodicTrajectory trajectory(phases);
  for (const double phase : {0.0, 0.7, 3.0, 12.0}) {
    EXPECT_NEAR(trajectory.at(phase)[0], 5.0 * std::sin(phase), 1e-9);
    EXPECT_NEAR(trajectory.derivative_at(phase)[0], 5.0 * std::cos(phase), 1e-9);
  }
  EXPECT_THROW(PeriodicTrajectory({one(1), one(2), one(3)}), UsageError);
}

TEST(PeriodicModel, FindsThePeriodOfBreathing) {
  std::vector<double> times_s;
  std::vector<VectorXd> positions;
  for (double t = 0.0; t < 25.0; t += 0.21) {
    times_s.push_back(t);
    positions.push_back(breathing(t, 3.7));
  }
  EXPECT_NEAR(period_of(times_s, positions).value(), 3.7, 0.15);
  for (VectorXd& position : positions) position.setConstant(2.0);
  EXPECT_FALSE(period_of(times_s, positions));
}

// A patient who breathes as in the 4D CT, deeper and from another place: the phases help before a breath is learned.
TEST(PeriodicModel, GivenPhasesFollowsAnotherDepthAndPlace) {
  PredictorOptions options{.latency_s = 0.4, .learning_s = 9.0};
  for (int n = 0; n < 10; ++n) options.phases_mm.push_back(breathing(0.4 * n));
  const auto motion = [](double t) -> VectorXd { return 1.3 * breathing(t * 4.0 / 4.4) + Eigen::Vector3d(5, -7, 1); };
  const auto with_phases = make_predictor(PredictorKind::kModel, options);
  const auto hold = make_predictor(PredictorKind::kHoldLast, options);
  EXPECT_LT(rms_error_mm(*with_phases, 0.4, motion, 0.1), 0.35 * rms_error_mm(*hold, 0.4, motion, 0.1));
}

// A trace that is its own prediction: sampled as it is scored, held for one sample.
TEST(Score, OfARampIsTheWayOfOneLatency) {
  std::vector<MotionSample> ramp;
  for (int n = 0; n <= 1000; ++n) ramp.push_back({5.0 + 0.13 * n, Eigen::Vector3d(0.0, 0.26 * n, 0.0)});
  const PredictionScore hold = score(PredictorKind::kHoldLast, {}, ramp, 0.3, {});
  EXPECT_NEAR(hold.rmse_mm, 0.6, 1e-9);  // 2 mm/s
  EXPECT_NEAR(hold.max_mm, 0.6, 1e-9);
  EXPECT_NEAR(static_cast<double>(hold.samples), (130.0 - 60.0) * 10.0, 1.0);
  EXPECT_LT(score(PredictorKind::kKalman, {}, ramp, 0.3, {}).rmse_mm, 1e-3);
  EXPECT_NEAR(resampled(ramp, 10.0)[7].position_mm.y(), 1.4, 1e-9);
}

TEST(Score, PercentilesOfFewErrorsLieBetweenThem) {
  const PredictionScore errors = score_of({10.0, 0.0});
  EXPECT_NEAR(errors.median_mm, 5.0, 1e-12);
  EXPECT_NEAR(errors.p95_mm, 9.5, 1e-12);
  EXPECT_NEAR(score_of({3.0}).p95_mm, 3.0, 1e-12);
}

// A latency between two samples is predicted from the one before: as far as that is.
TEST(Score, LatenciesOffTheGridAreLearnedAsFarAsTheyReach) {
  std::vector<MotionSample> sine;
  for (int n = 0; n <= 1500; ++n) sine.push_back({0.1 * n, Eigen::Vector3d(0.0, 5.0 * std::sin(0.15 * n), 0.0)});
  for (const double latency_s : {0.3, 0.31, 0.45})
    EXPECT_LT(score(PredictorKind::kRls, {}, sine, latency_s, {}).rmse_mm, 0.05) << latency_s;
}

}  // namespace
}  // namespace isoshift::predictor_test
