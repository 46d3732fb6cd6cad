#include "workflow/commission/localization.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "base/error.h"
#include "geometry/rotation.h"
#include "tests/support/pose_near.h"

namespace isoshift::localization_test {
namespace {

using testing::DoubleNear;
using testing::HasSubstr;

constexpr LocalizationLimits kLimits{.translation_mm = 0.5, .rotation_deg = 0.3};

Eigen::Isometry3d motion(const Eigen::Vector3d& mm, const Eigen::Vector3d& deg = Eigen::Vector3d::Zero()) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = mm;
  pose.linear() = rotation_from_zxy({rad_from_deg(deg.z()), rad_from_deg(deg.x()), rad_from_deg(deg.y())});
  return pose;
}

NamedResult session(const std::string& name, const Eigen::Isometry3d& setup_error, double sigma_mm = 0.1,
                    double sigma_deg = 0.05) {
  NamedResult one{.name = name, .result = {}};
  one.result.findings.clear();
  one.result.patient_position = "HFS";
  one.result.views.resize(1);
  one.result.views.front().gantry_deg = 0.0;
  one.result.isocenter_patient_mm = {10, -20, 30};
  one.result.setup_error = setup_error;
  one.result.uncertainty = uncertainty_of_independent_axes(Eigen::Vector3d::Constant(sigma_mm),
                                                           Eigen::Vector3d::Constant(rad_from_deg(sigma_deg)));
  return one;
}

// A session of which the imagers may put every translation off, too.
NamedResult by_imagers_too(NamedResult one, const Eigen::Vector3d& sigma_mm) {
  one.result.by_imagers = uncertainty_of_independent_axes(sigma_mm, Eigen::Vector3d::Zero());
  one.result.uncertainty->covariance += one.result.by_imagers->covariance;
  return one;
}

NamedResult on_table(NamedResult one, const Eigen::Vector3d& position_mm, double support_deg = 0.0) {
  one.result.table_position_mm = position_mm;
  one.result.table.support_rad = rad_from_deg(support_deg);
  return one;
}

// Two moves along x, found 0.1 and 0.3 mm too far: bias 0.2, SD 0.1 sqrt(2); t of one degree of freedom is 12.706, and
// the first session's own error turns 1/2 into 1/2 + 1.
TEST(Localization, MovesAreAgainstTheFirstSession) {
  const Localization found = localization_of(
      {session("a", motion({1, 1, 1})), session("b", motion({4.1, 1, 1})), session("c", motion({-1.7, 1, 1}))},
      Known::kMoves, {{{"a", motion({7, 0, 0})}, {"b", motion({10, 0, 0})}, {"c", motion({4, 0, 0})}}}, kLimits);
  EXPECT_EQ(found.reference, "a");
  ASSERT_EQ(found.all.size(), 2U);
  const AxisOfLocalization& x = found.axes[0];
  EXPECT_NEAR(x.errors->bias, 0.2, 1e-12);
  EXPECT_NEAR(x.errors->sd.value(), 0.1 * std::numbers::sqrt2, 1e-12);
  EXPECT_NEAR(x.errors->bias_within.value(), 12.706 * 0.1 * std::numbers::sqrt2 * std::sqrt(1.5), 1e-3);
  EXPECT_NEAR(x.largest, 0.3, 1e-12);
  EXPECT_EQ(x.least_known, -3.0);
  EXPECT_EQ(x.most_known, 3.0);
  EXPECT_EQ(x.limit, Outcome::kPassed);
  EXPECT_EQ(found.polarity(0), Outcome::kPassed);
  EXPECT_EQ(found.polarity(1), Outcome::kUntested);
  // Both sessions have a sigma of 0.1 mm.
  EXPECT_NEAR(found.all[0].sigma[0].value(), 0.1 * std::numbers::sqrt2, 1e-9);
}

TEST(Localization, PositionsHaveABiasOfTheirOwn) {
  const Localization found =
      localization_of({session("a", motion({1.2, 0, 0})), session("b", motion({4.2, 0, -0.6}))}, Known::kPositions,
                      {{{"a", motion({1, 0, 0})}, {"b", motion({4, 0, 0})}}}, kLimits);
  EXPECT_TRUE(found.reference.empty());
  EXPECT_NEAR(found.axes[0].errors->bias, 0.2, 1e-12);
  EXPECT_NEAR(found.axes[0].errors->bias_within.value(), 0.0, 1e-9);
  EXPECT_EQ(found.axes[2].limit, Outcome::kFailed) << "0.6 mm, where the limit is 0.5";
}

// The phantom was found where it is known to lie, and turned, of which the table says nothing: 2.5 degrees at 8 mm are
// 0.35 mm.
TEST(Localization, WithoutAnglesAnUnknownRotationIsNoErrorOfThePosition) {
  const std::vector<Eigen::Vector3d> mm = {{1, 2, -3}, {8, 2, -3}, {1, 8, 5}, {-6, 2, 8}};
  const std::vector<Eigen::Vector3d> deg = {{0.5, 0, 1}, {0, 0, 2.5}, {2.5, 1, 0}, {1, -2.5, 2}};
  for (const Known known : {Known::kPositions, Known::kMoves}) {
    std::vector<NamedResult> sessions;
    KnownPoses poses{.by_session = {}, .have_angles = false, .sha256 = ""};
    for (std::size_t n = 0; n < mm.size(); ++n) {
      sessions.push_back(session(std::to_string(n), motion(mm[n], deg[n])));
      sessions.back().result.isocenter_patient_mm = {0, 0, 0};
      poses.by_session[sessions.back().name] = motion(mm[n]);
    }
    const Localization found = localization_of(sessions, known, poses, kLimits);
    for (const Localized& one : found.all)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(one.error[axis].value(), 0.0, 1e-9) << one.session << ", axis " << axis;
        EXPECT_NEAR(one.found[axis], one.known[axis].value(), 1e-9) << "the columns say the same";
        EXPECT_FALSE(one.error[axis + 3]);
      }
    EXPECT_EQ(found.calibration.outcome, Outcome::kPassed);
    for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_EQ(found.axes[axis].limit, Outcome::kPassed);
  }
}

// Of a point that lies 100 mm off the isocenter: 0.05 degrees are 0.087 mm there.
TEST(Localization, WithoutAnglesTheSigmaIsThatOfThePointThatIsKnown) {
  const Localization found = localization_of({session("a", motion({100, 0, 0}))}, Known::kPositions,
                                             {{{"a", motion({100, 0, 0})}}, false, ""}, kLimits);
  const double turned_mm = 100.0 * rad_from_deg(0.05);
  EXPECT_NEAR(found.all[0].sigma[0].value(), 0.1, 1e-9);
  EXPECT_NEAR(found.all[0].sigma[1].value(), std::hypot(0.1, turned_mm), 1e-9);
}

TEST(Localization, AWrongSignOfAnyAxisIsFound) {
  for (std::size_t axis = 0; axis < 6; ++axis) {
    Eigen::Vector3d mm = Eigen::Vector3d::Zero(), deg = Eigen::Vector3d::Zero();
    (axis < 3 ? mm : deg)[static_cast<Eigen::Index>(axis % 3)] = 2.0;
    const auto polarity = [&](double sign) {
      return localization_of({session("a", motion({0, 0, 0})), session("b", motion(sign * mm, sign * deg))},
                             Known::kMoves, {{{"a", motion({0, 0, 0})}, {"b", motion(mm, deg)}}}, std::nullopt)
          .polarity(axis);
    };
    EXPECT_EQ(polarity(1.0), Outcome::kPassed) << axis;
    EXPECT_EQ(polarity(-1.0), Outcome::kFailed) << axis;
    EXPECT_EQ(polarity(0.0), Outcome::kFailed) << axis;
  }
}

TEST(Localization, ABiasIsNoWrongSign) {
  const Localization found =
      localization_of({session("a", motion({1.2, 0, 0})), session("b", motion({2.7, 0, 0}))}, Known::kPositions,
                      {{{"a", motion({0, 0, 0})}, {"b", motion({1.5, 0, 0})}}}, kLimits);
  EXPECT_EQ(found.polarity(0), Outcome::kPassed);
  EXPECT_EQ(found.axes[0].limit, Outcome::kFailed);
}

// Half a turn is 180 or -180 degrees.
TEST(Localization, HalfATurnHasNoWrongSign) {
  for (const double found_deg : {179.9, 180.1}) {
    const Localization found = localization_of(
        {session("a", motion({0, 0, 0})), session("b", motion({0, 0, 0}, {0, 0, found_deg}))}, Known::kPositions,
        {{{"a", motion({0, 0, 0})}, {"b", motion({0, 0, 0}, {0, 0, 180})}}}, kLimits);
    EXPECT_EQ(found.polarity(5), Outcome::kPassed) << found_deg;
  }
}

TEST(Localization, ASinglePositionShowsNoSign) {
  const Localization found = localization_of({session("a", motion({5, 5, 5}, {3, 3, 3}))}, Known::kPositions,
                                             {{{"a", motion({5, 5, 5}, {3, 3, 3})}}}, kLimits);
  for (std::size_t axis = 0; axis < 6; ++axis) EXPECT_EQ(found.polarity(axis), Outcome::kUntested) << axis;
}

// Moves between patient positions, or between beams, show no sign within one of them.
TEST(Localization, EveryPatientPositionAndBeamHasSignsOfItsOwn) {
  NamedResult prone = session("c", motion({0, 0, 0})), moved = session("d", motion({-3, 0, 0}));
  NamedResult portal = session("e", motion({3, 0, 0}));
  for (NamedResult* one : {&prone, &moved}) one->result.patient_position = "HFP";
  portal.result.views.front().is_megavoltage = true;
  const Localization found = localization_of(
      {session("a", motion({0, 0, 0})), session("b", motion({3, 0, 0})), prone, moved, portal}, Known::kPositions,
      {{{"a", motion({0, 0, 0})},
        {"b", motion({3, 0, 0})},
        {"c", motion({0, 0, 0})},
        {"d", motion({3, 0, 0})},
        {"e", motion({3, 0, 0})}}},
      kLimits);
  EXPECT_EQ(found.polarities.at("HFS, kV")[0], Outcome::kPassed);
  EXPECT_EQ(found.polarities.at("HFP, kV")[0], Outcome::kFailed);
  EXPECT_EQ(found.polarities.at("HFS, MV")[0], Outcome::kUntested);
  EXPECT_EQ(found.polarity(0), Outcome::kFailed);
}

// A view from the front does not see the room's y of the first session. A table turned by 90 degrees makes it the x of
// the second one.
TEST(Localization, WhatTheFirstSessionDoesNotSeeIsInNoMove) {
  NamedResult first = on_table(session("a", motion({0, 0, 0})), {0, 0, 0});
  first.result.unobservable_room = {Eigen::Vector3d::UnitY()};
  const Localization found = localization_of({first, on_table(session("b", motion({0, 0, 0})), {0, 0, 0}, 90.0)},
                                             Known::kReadOuts, {}, kLimits);
  EXPECT_FALSE(found.all.front().error[0]);
  EXPECT_TRUE(found.all.front().error[1]);
  EXPECT_TRUE(found.all.front().error[2]);
}

TEST(Localization, WithoutKnownAnglesRotationsAreNotJudged) {
  const Localization found = localization_of(
      {session("a", motion({0, 0, 0}, {2, 0, 0})), session("b", motion({3, 0, 0}))}, Known::kPositions,
      {.by_session = {{"a", motion({0, 0, 0})}, {"b", motion({3, 0, 0})}}, .have_angles = false}, kLimits);
  EXPECT_TRUE(found.axes[0].errors);
  EXPECT_EQ(found.all.back().known[0], 3.0);
  for (std::size_t axis = 3; axis < 6; ++axis) {
    EXPECT_FALSE(found.axes[axis].errors) << axis;
    EXPECT_FALSE(found.axes[axis].least_known) << axis;
    EXPECT_FALSE(found.all.back().known[axis]) << axis;
  }
}

// A table at 90 degrees carries its lateral axis to the room's y. The planned pose turns with the table, so that a
// phantom that is carried along keeps its setup error but for the translation.
TEST(Localization, ReadOutsMoveThePhantomWithTheTable) {
  const NamedResult before = on_table(session("a", motion({0, 0, 0})), {10, 1000, -150}, 90.0);
  const Localization moved = localization_of(
      {before, on_table(session("b", motion({0, 5, 2})), {15, 1000, -148}, 90.0)}, Known::kReadOuts, {}, kLimits);
  EXPECT_THAT(*moved.all.front().known[1], DoubleNear(5.0, 1e-9));
  EXPECT_THAT(*moved.all.front().known[2], DoubleNear(2.0, 1e-9));
  for (const auto& error : moved.all.front().error) EXPECT_THAT(error.value(), DoubleNear(0.0, 1e-9));

  // A turn about the isocenter carries a phantom that lies off it along an arc.
  const Eigen::Isometry3d off = motion({30, 0, 0});
  const Localization turned = localization_of(
      {on_table(session("a", off), {0, 0, 0}), on_table(session("b", motion({0, 30, 0})), {0, 0, 0}, 90.0)},
      Known::kReadOuts, {}, kLimits);
  EXPECT_THAT(*turned.all.front().known[5], DoubleNear(90.0, 1e-9));
  for (const auto& error : turned.all.front().error) EXPECT_THAT(error.value(), DoubleNear(0.0, 1e-9));
}

TEST(Localization, WhatReadOutsDoNotSayIsRefused) {
  const auto refusal = [](const NamedResult& second) {
    try {
      localization_of({on_table(session("a", motion({0, 0, 0})), {0, 0, 0}), second}, Known::kReadOuts, {}, kLimits);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("not refused");
  };
  EXPECT_THAT(refusal(session("b", motion({0, 0, 0}))), HasSubstr("session b: its X-rays do not say where the table"));
  NamedResult pitched = on_table(session("b", motion({0, 0, 0})), {0, 0, 0});
  pitched.result.table.pitch_rad = rad_from_deg(1.0);
  EXPECT_THAT(refusal(pitched), HasSubstr("the table's pitch differs by 1.00 degrees"));
  NamedResult eccentric = on_table(session("b", motion({0, 0, 0})), {0, 0, 0});
  eccentric.result.table.eccentric_rad = rad_from_deg(5.0);
  EXPECT_THAT(refusal(eccentric), HasSubstr("the table's eccentric angle differs by 5.00 degrees"));
}

TEST(Localization, SessionsAndKnownPosesNameEachOther) {
  const std::vector<NamedResult> sessions = {session("a", motion({0, 0, 0})), session("b", motion({0, 0, 0}))};
  const auto locate = [&](const KnownPoses& poses) { localization_of(sessions, Known::kMoves, poses, kLimits); };
  EXPECT_THROW(locate({{{"a", motion({0, 0, 0})}}}), Error);
  EXPECT_THROW(locate({{{"a", motion({0, 0, 0})}, {"b", motion({0, 0, 0})}, {"c", motion({0, 0, 0})}}}), Error);
  EXPECT_THROW(localization_of({sessions.front()}, Known::kMoves, {{{"a", motion({0, 0, 0})}}}, kLimits), Error);
}

TEST(Localization, AxesThatXraysDoNotDetermineHaveNoErrors) {
  NamedResult a = session("a", motion({0, 0, 0})), b = session("b", motion({1, 0, 0}));
  for (NamedResult* one : {&a, &b}) {
    one->result.translation_only = true;
    one->result.unobservable_room = {Eigen::Vector3d::UnitZ()};
  }
  const Localization found =
      localization_of({a, b}, Known::kMoves, {{{"a", motion({0, 0, 0})}, {"b", motion({1, 0, 0})}}}, kLimits);
  EXPECT_TRUE(found.axes[0].errors);
  for (const std::size_t axis : {2U, 3U, 4U, 5U}) {
    EXPECT_FALSE(found.axes[axis].errors) << axis;
    EXPECT_EQ(found.axes[axis].limit, Outcome::kUntested) << axis;
  }
}

// 20 positions, 6 axes each: errors of three sigma everywhere must fail, of half a sigma pass.
TEST(Localization, UncertaintiesThatAreTooSmallFail) {
  const auto calibrated = [](double sigmas) {
    std::vector<NamedResult> sessions;
    KnownPoses poses;
    for (int n = 0; n < 20; ++n) {
      const double mm = 0.1 * sigmas, deg = 0.05 * sigmas;
      sessions.push_back(session(std::to_string(n), motion({mm, -mm, mm}, {deg, -deg, deg})));
      poses.by_session[std::to_string(n)] = motion({0, 0, 0});
    }
    return localization_of(sessions, Known::kPositions, poses, kLimits);
  };
  EXPECT_EQ(calibrated(3.0).calibration.outcome, Outcome::kFailed);
  EXPECT_EQ(calibrated(3.0).calibration.within_one_sigma->of, 0U);
  EXPECT_EQ(calibrated(0.5).calibration.outcome, Outcome::kPassed);
  EXPECT_EQ(calibrated(0.5).calibration.within_two_sigma->of, 120U);
}

// How the sessions of a site alternate.
struct Site {
  Known known = Known::kMoves;
  double imagers_mm = 0.0;        // one sigma of what the imagers put off, for each pair of gantry angles
  double other_gantry_deg = 0.0;  // of every second session
  double other_couch_deg = 0.0;
};

// The errors of all sessions of a site are drawn with the sigmas that they have, and the same error of the imagers for
// all sessions of a gantry angle. Returns of how many sites the test of the sigmas fails.
int failing_sites(const Site& site) {
  constexpr int kSites = 1000, kSessions = 20;
  constexpr double kMm = 0.1, kDeg = 0.05;
  std::mt19937 random(20261127);
  std::normal_distribution<double> normal;
  const auto drawn = [&](double sigma) {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(sigma * Eigen::Vector3d(x, y, z));
  };
  int failed = 0;
  for (int n_site = 0; n_site < kSites; ++n_site) {
    std::vector<NamedResult> sessions;
    KnownPoses poses;
    const std::array by_imagers = {drawn(site.imagers_mm), drawn(site.imagers_mm)};
    for (int n = 0; n < kSessions; ++n) {
      const bool is_other = n % 2 == 1;
      const Eigen::Vector3d mm = drawn(kMm), deg = drawn(kDeg);
      const Eigen::Vector3d off = by_imagers[is_other && site.other_gantry_deg != 0.0 ? 1 : 0];
      // A phantom that the couch carries along keeps its setup error, but for what was put off in the room.
      NamedResult one = by_imagers_too(session(std::to_string(n), motion(mm + off, deg), kMm, kDeg),
                                       Eigen::Vector3d::Constant(site.imagers_mm));
      const double couch_deg = is_other ? site.other_couch_deg : 0.0;
      one.result.views.front().gantry_deg = is_other ? site.other_gantry_deg : 0.0;
      one.result.table.support_rad = rad_from_deg(couch_deg);
      sessions.push_back(std::move(one));
      poses.by_session[std::to_string(n)] =
          site.known == Known::kMoves ? motion({0, 0, 0}, {0, 0, couch_deg}) : motion({0, 0, 0});
    }
    const Localization found = localization_of(sessions, site.known, poses, kLimits);
    EXPECT_GE(found.calibration.within_one_sigma->total, 6U * (kSessions - 2));
    failed += found.calibration.outcome == Outcome::kFailed ? 1 : 0;
  }
  return failed;
}

// Moves share the first session, and positions what the imagers put off; the test of the sigmas must not take an error
// that several share for many. Of 1000 sites the two one-sided tests at 2.5 % fail at most 50, that of the imagers at 1
// % fails 10 more; two standard deviations of chance are 14.
TEST(Localization, UncertaintiesThatAreRightSeldomFail) {
  EXPECT_LE(failing_sites({.known = Known::kMoves}), 64);
  EXPECT_LE(failing_sites({.known = Known::kMoves, .other_gantry_deg = 90.0, .other_couch_deg = 90.0}), 64);
  EXPECT_LE(failing_sites({.known = Known::kMoves, .imagers_mm = 0.3, .other_gantry_deg = 90.0}), 64);
  EXPECT_LE(failing_sites({.known = Known::kMoves, .imagers_mm = 0.3, .other_couch_deg = 90.0}), 64);
  EXPECT_LE(failing_sites({.known = Known::kPositions}), 64);
  EXPECT_LE(failing_sites({.known = Known::kPositions, .imagers_mm = 0.3}), 75);
  EXPECT_LE(failing_sites({.known = Known::kPositions, .imagers_mm = 0.3, .other_gantry_deg = 90.0}), 75);
}

// Imagers that are known to 0.3 mm may put all positions off by 0.5 mm, but not by 1.5 mm.
TEST(Localization, WhatImagersPutOffIsTestedOnce) {
  const auto off_by = [](double mm) {
    std::vector<NamedResult> sessions;
    KnownPoses poses;
    for (int n = 0; n < 20; ++n) {
      sessions.push_back(
          by_imagers_too(session(std::to_string(n), motion({mm, 0, 0})), Eigen::Vector3d::Constant(0.3)));
      poses.by_session[std::to_string(n)] = motion({0, 0, 0});
    }
    return localization_of(sessions, Known::kPositions, poses, kLimits);
  };
  EXPECT_EQ(off_by(0.5).calibration.outcome, Outcome::kPassed);
  EXPECT_NEAR(off_by(0.5).calibration.shared_sigmas.value(), 0.5 / std::hypot(0.3, 0.1 / std::sqrt(20.0)), 1e-9);
  EXPECT_EQ(off_by(1.5).calibration.outcome, Outcome::kFailed);
  // Translations against those before, which agree; nothing is known of what imagers do to rotations.
  EXPECT_EQ(off_by(1.5).calibration.within_one_sigma->of, 3U * 19 + 3U * 20);
}

// An imager that puts x off by 1 mm puts a move along x off by nothing. A table that turns by 90 degrees carries the
// first session's error to y, and another gantry angle has another error.
TEST(Localization, WhatImagersPutOffIsInMovesAsFarAsItDoesNotCancel) {
  const Eigen::Vector3d along_x(1, 0, 0);
  const auto sigma_of_move = [&](NamedResult second, const Eigen::Isometry3d& known) {
    const Localization found = localization_of(
        {by_imagers_too(session("a", motion({0, 0, 0})), along_x), by_imagers_too(std::move(second), along_x)},
        Known::kMoves, {{{"a", motion({0, 0, 0})}, {"b", known}}}, kLimits);
    return found.all.front().sigma;
  };
  const double of_sessions = 0.1 * std::numbers::sqrt2;
  const auto moved = sigma_of_move(session("b", motion({5, 0, 0})), motion({5, 0, 0}));
  EXPECT_NEAR(moved[0].value(), of_sessions, 1e-9);
  const auto turned = sigma_of_move(session("b", motion({0, 0, 0}, {0, 0, 90})), motion({0, 0, 0}, {0, 0, 90}));
  EXPECT_NEAR(turned[0].value(), std::hypot(of_sessions, 1.0), 1e-9);
  EXPECT_NEAR(turned[1].value(), std::hypot(of_sessions, 1.0), 1e-9);
  EXPECT_NEAR(turned[2].value(), of_sessions, 1e-9);
  NamedResult from_aside = session("b", motion({5, 0, 0}));
  from_aside.result.views.front().gantry_deg = 90.0;
  EXPECT_NEAR(sigma_of_move(from_aside, motion({5, 0, 0}))[0].value(), std::hypot(of_sessions, std::numbers::sqrt2),
              1e-9);
  NamedResult around = session("b", motion({5, 0, 0}));
  around.result.views.front().gantry_deg = 359.6;
  EXPECT_NEAR(sigma_of_move(around, motion({5, 0, 0}))[0].value(), of_sessions, 1e-9);
}

// Images that do not determine the pose give no uncertainty, and the imagers' sigma is not all of it.
TEST(Localization, ASessionWithoutUncertaintyHasNoSigma) {
  NamedResult without = by_imagers_too(session("b", motion({1, 0, 0})), {1, 1, 1});
  without.result.uncertainty.reset();
  const Localization found =
      localization_of({by_imagers_too(session("a", motion({0, 0, 0})), {1, 1, 1}), without}, Known::kPositions,
                      {{{"a", motion({0, 0, 0})}, {"b", motion({0, 0, 0})}}}, kLimits);
  EXPECT_TRUE(found.all.front().sigma[0]);
  EXPECT_TRUE(found.all.back().error[0]);
  EXPECT_FALSE(found.all.back().sigma[0]);
}

// A session that does not determine an axis takes it from no other one.
TEST(Localization, SessionsThatDetermineLessAreTestedAmongThemselves) {
  std::vector<NamedResult> sessions;
  KnownPoses poses;
  for (int n = 0; n < 5; ++n) {
    sessions.push_back(session(std::to_string(n), motion({0, 0, 0})));
    if (n < 2) sessions.back().result.unobservable_room = {Eigen::Vector3d::UnitY()};
    poses.by_session[std::to_string(n)] = motion({0, 0, 0});
  }
  // x and z of two sessions, all six axes of three.
  EXPECT_EQ(localization_of(sessions, Known::kPositions, poses, kLimits).calibration.within_one_sigma->total,
            2U * 2 + 6U * 3);
  EXPECT_EQ(localization_of(sessions, Known::kMoves, poses, kLimits).calibration.within_one_sigma->total,
            2U * 1 + 6U * 2);
}

}  // namespace
}  // namespace isoshift::localization_test
