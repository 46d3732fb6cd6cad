#include "registration/evaluate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "base/error.h"
#include "geometry/rotation.h"
#include "geometry/target_error.h"
#include "tests/support/pose_near.h"

namespace isoshift::evaluate_test {
namespace {

using Eigen::Isometry3d;

Isometry3d some_truth() {
  Isometry3d truth(Eigen::AngleAxisd(0.07, Eigen::Vector3d(1, -2, 1).normalized()));
  truth.translation() = Eigen::Vector3d(6.0, -4.0, 9.0);
  return truth;
}

double angle_rad(const Isometry3d& start, const Isometry3d& truth) {
  return Eigen::AngleAxisd(start.linear() * truth.linear().transpose()).angle();
}

TEST(StartPoses, TwoHundredLieTenToAMillimeter) {
  const std::vector<StartPose> starts = start_poses(some_truth(), {});
  ASSERT_EQ(starts.size(), 200U);
  std::map<int, int> of_bin;
  for (const StartPose& start : starts) {
    const double mtre_mm = mean_target_registration_error_mm(start.setup_error, some_truth(), standard_targets_mm());
    EXPECT_NEAR(start.mtre_mm, mtre_mm, 1e-9);
    EXPECT_LE(angle_rad(start.setup_error, some_truth()), rad_from_deg(10.0) + 1e-9);
    ++of_bin[static_cast<int>(std::floor(mtre_mm))];
  }
  ASSERT_EQ(of_bin.size(), 20U);
  for (const auto& [bin, count] : of_bin) {
    EXPECT_EQ(count, 10) << bin << " mm";
    EXPECT_GE(bin, 0);
    EXPECT_LT(bin, 20);
  }
}

TEST(StartPoses, RotationsAndDirectionsAreSpreadOut) {
  Eigen::Vector3d sum_of_directions = Eigen::Vector3d::Zero();
  double largest_deg = 0.0;
  for (const StartPose& start : start_poses(some_truth(), {})) {
    sum_of_directions += (start.setup_error.translation() - some_truth().translation()).normalized();
    largest_deg = std::max(largest_deg, deg_from_rad(angle_rad(start.setup_error, some_truth())));
  }
  // A random walk of 200 steps in three dimensions ends beyond 3 sqrt(200) = 42 less than once in 10^5 times.
  EXPECT_LT(sum_of_directions.norm(), 42.0);
  EXPECT_GT(largest_deg, 9.0);
}

TEST(StartPoses, SameSeedSameStartsAndFewerAreTheFirstOfMore) {
  const std::vector<StartPose> all = start_poses(some_truth(), {.count = 40});
  const std::vector<StartPose> again = start_poses(some_truth(), {.count = 40});
  const std::vector<StartPose> fewer = start_poses(some_truth(), {.count = 7});
  const std::vector<StartPose> other = start_poses(some_truth(), {.count = 40, .seed = 2});
  ASSERT_EQ(fewer.size(), 7U);
  for (std::size_t n = 0; n < all.size(); ++n) {
    EXPECT_EQ(again[n].setup_error.matrix(), all[n].setup_error.matrix()) << n;
    EXPECT_NE(other[n].setup_error.matrix(), all[n].setup_error.matrix()) << n;
  }
  for (std::size_t n = 0; n < fewer.size(); ++n)
    EXPECT_EQ(fewer[n].setup_error.matrix(), all[n].setup_error.matrix()) << n;
  // All 64 bits of a seed count.
  EXPECT_NE(start_poses(some_truth(), {.count = 1, .seed = (1ULL << 32) + 1}).front().setup_error.matrix(),
            all.front().setup_error.matrix());
}

TEST(StartPoses, OfAnotherRangeFillItToo) {
  std::map<int, int> of_bin;
  for (const StartPose& start : start_poses(some_truth(), {.distance_mm = 5.0, .count = 50}))
    ++of_bin[static_cast<int>(start.mtre_mm)];
  EXPECT_THAT(of_bin, testing::ElementsAre(std::pair(0, 10), std::pair(1, 10), std::pair(2, 10), std::pair(3, 10),
                                           std::pair(4, 10)));
  for (const StartPose& start : start_poses(some_truth(), {.distance_mm = 0.5, .count = 5}))
    EXPECT_LE(start.mtre_mm, 0.5);
  for (const StartPose& start : start_poses(some_truth(), {.max_rotation_rad = 0.0, .count = 20}))
    EXPECT_NEAR(angle_rad(start.setup_error, some_truth()), 0.0, 1e-7);
}

TEST(StartPoses, OfThePaperAre25MmAwayAndTurnedByUpTo5Degrees) {
  const std::vector<StartPose> starts = start_poses(some_truth(), StartProtocol::paper());
  ASSERT_EQ(starts.size(), 150U);
  double largest_deg = 0.0;
  for (const StartPose& start : starts) {
    EXPECT_NEAR((start.setup_error.translation() - some_truth().translation()).norm(), 25.0, 1e-9);
    const ZxyAngles angles = zxy_from_rotation(start.setup_error.linear() * some_truth().linear().transpose());
    for (const double rad : {angles.x_rad, angles.y_rad, angles.z_rad}) {
      EXPECT_LE(std::abs(deg_from_rad(rad)), 5.0 + 1e-9);
      largest_deg = std::max(largest_deg, std::abs(deg_from_rad(rad)));
    }
  }
  EXPECT_GT(largest_deg, 4.5);
}

TEST(StartPoses, OfThePaperNeedNotBeTurned) {
  StartProtocol protocol = StartProtocol::paper();
  protocol.max_rotation_rad = 0.0;
  for (const StartPose& start : start_poses(some_truth(), protocol)) {
    EXPECT_TRUE(start.setup_error.linear().isApprox(some_truth().linear(), 1e-12));
    EXPECT_NEAR(start.mtre_mm, 25.0, 1e-9);  // every target moves by the same vector
  }
}

TEST(StartPoses, OfOneMtreHaveItWhateverTheirRotation) {
  double largest_deg = 0.0;
  for (const StartPose& start : start_poses(
           some_truth(), {.series = StartProtocol::Series::kMtre, .distance_mm = 25.0, .count = 50, .seed = 3})) {
    EXPECT_NEAR(mean_target_registration_error_mm(start.setup_error, some_truth(), standard_targets_mm()), 25.0, 1e-6);
    EXPECT_LE(angle_rad(start.setup_error, some_truth()), rad_from_deg(10.0) + 1e-9);
    largest_deg = std::max(largest_deg, deg_from_rad(angle_rad(start.setup_error, some_truth())));
  }
  EXPECT_GT(largest_deg, 8.0);
}

TEST(StartPoses, RefuseNonsense) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const StartProtocol& protocol :
       {StartProtocol{.distance_mm = 0.0}, StartProtocol{.distance_mm = kNan}, StartProtocol{.max_rotation_rad = -0.1},
        StartProtocol{.max_rotation_rad = kNan}, StartProtocol{.count = 0}})
    EXPECT_THROW(start_poses(some_truth(), protocol), UsageError);
}

EvaluatedRun run_with(double start_mtre_mm, double mtre_mm, Verdict verdict = Verdict::kReview) {
  return {.start_mtre_mm = start_mtre_mm, .mtre_mm = mtre_mm, .mrpd_mm = mtre_mm, .verdict = verdict};
}

TEST(EvaluationSummary, AveragesTheSuccesses) {
  std::vector<EvaluatedRun> runs = {run_with(0.5, 0.2), run_with(1.5, 0.4), run_with(2.5, 0.9), run_with(3.5, 1.1),
                                    run_with(4.5, 30.0)};
  for (std::size_t n = 0; n < runs.size(); ++n) {
    runs[n].mpd_mm = 2.0 * runs[n].mtre_mm;
    runs[n].mrpd_mm = 0.5 * runs[n].mtre_mm;
    runs[n].evaluations = 100 + 10 * static_cast<int>(n);
    runs[n].seconds = std::array{1.0, 2.0, 3.0, 4.0, 10.0}[n];
    runs[n].seconds_rendering = 0.5 * runs[n].seconds;
    runs[n].seconds_similarity = 0.25 * runs[n].seconds;
  }
  const EvaluationSummary summary = summarized(runs, /*by_mrpd=*/false);
  EXPECT_EQ(summary.runs, 5);
  EXPECT_EQ(summary.successes, 4);
  EXPECT_DOUBLE_EQ(summary.success_share(), 0.8);
  EXPECT_NEAR(summary.mean_mm, 0.65, 1e-12);
  EXPECT_NEAR(summary.median_mm, 0.65, 1e-12);  // between 0.4 and 0.9
  // Deviations 0.45, 0.25, 0.25, 0.45; the sample's, over n - 1.
  EXPECT_NEAR(summary.sd_mm, std::sqrt((2 * 0.45 * 0.45 + 2 * 0.25 * 0.25) / 3.0), 1e-12);
  EXPECT_NEAR(summary.mean_mpd_mm, 1.3, 1e-12);
  EXPECT_NEAR(summary.mean_mrpd_mm, 0.325, 1e-12);
  // Of all runs, whether they succeeded or not.
  EXPECT_NEAR(summary.median_seconds, 3.0, 1e-12);
  EXPECT_NEAR(summary.mean_evaluations, 120.0, 1e-12);
  EXPECT_NEAR(summary.rendering_share, 0.5, 1e-12);
  EXPECT_NEAR(summary.similarity_share, 0.25, 1e-12);

  runs.erase(runs.begin() + 3);  // three successes: the one in the middle
  EXPECT_NEAR(summarized(runs, false).median_mm, 0.4, 1e-12);
}

// Worked by hand: 1, 2 and 6 mm have the mean 3 and the deviations -2, -1, 3, so that SD^2 = (4 + 1 + 9) / 2.
TEST(EvaluationSummary, OverAllRunsCountsFailuresButNotRunsWithoutAPose) {
  constexpr double kNothing = std::numeric_limits<double>::infinity();
  std::vector<EvaluatedRun> runs = {run_with(25, 1.0), run_with(25, 2.0), run_with(25, 6.0), run_with(25, kNothing)};
  for (std::size_t n = 0; n < runs.size(); ++n) {
    runs[n].mpd_mm = 1.5 * runs[n].mtre_mm;
    runs[n].evaluations = std::array{100, 200, 300, 0}[n];
    runs[n].seconds = 10.0;  // with all checks
    runs[n].seconds_rendering = std::array{1.0, 2.0, 3.0, 0.0}[n];
    runs[n].seconds_similarity = std::array{0.5, 0.5, 1.0, 0.0}[n];
  }
  const EvaluationSummary summary = summarized(runs, /*by_mrpd=*/false);
  EXPECT_EQ(summary.runs, 4);
  EXPECT_EQ(summary.successes, 1);
  EXPECT_EQ(summary.all.runs, 3);
  EXPECT_NEAR(summary.all.mtre_mm.mean, 3.0, 1e-12);
  EXPECT_NEAR(summary.all.mtre_mm.sd, std::sqrt(7.0), 1e-12);
  EXPECT_NEAR(summary.all.mpd_mm.mean, 4.5, 1e-12);
  EXPECT_NEAR(summary.all.mrpd_mm.mean, 3.0, 1e-12);
  EXPECT_NEAR(summary.all.evaluations.mean, 200.0, 1e-12);
  EXPECT_NEAR(summary.all.evaluations.sd, 100.0, 1e-12);
  EXPECT_NEAR(summary.all.search_seconds.mean, 8.0 / 3.0, 1e-12);
  EXPECT_NEAR(summary.all.rendering_share, 6.0 / 8.0, 1e-12) << "of rendering and similarity, not of the call";
}

TEST(EvaluationSummary, SuccessIsBelowTwoMillimeters) {
  const std::vector<EvaluatedRun> runs = {run_with(1.0, 1.999), run_with(1.0, 2.0),
                                          run_with(1.0, std::numeric_limits<double>::quiet_NaN())};
  EXPECT_EQ(summarized(runs, false).successes, 1);
}

TEST(EvaluationSummary, ASingleViewIsJudgedByWhatItCanSee) {
  std::vector<EvaluatedRun> runs = {run_with(5.5, 12.0), run_with(5.5, 0.5)};
  runs[0].mrpd_mm = 0.7;  // 12 mm off, nearly all of it along the ray
  runs[1].mrpd_mm = 2.5;
  EXPECT_EQ(summarized(runs, false).successes, 1);
  EXPECT_NEAR(summarized(runs, false).mean_mm, 0.5, 1e-12);
  EXPECT_EQ(summarized(runs, true).successes, 1);
  EXPECT_NEAR(summarized(runs, true).mean_mrpd_mm, 0.7, 1e-12);
}

std::vector<EvaluatedRun> runs_in_bin(int start_mm, int successes, int failures) {
  std::vector<EvaluatedRun> runs;
  for (int n = 0; n < successes + failures; ++n)
    runs.push_back(run_with(start_mm + 0.05 * n, n < successes ? 0.3 : 9.0));
  return runs;
}

std::vector<EvaluatedRun> all_of(std::initializer_list<std::vector<EvaluatedRun>> parts) {
  std::vector<EvaluatedRun> runs;
  for (const auto& part : parts) runs.insert(runs.end(), part.begin(), part.end());
  return runs;
}

TEST(EvaluationSummary, CaptureRangeEndsBeforeTheFirstBinThatFails) {
  EXPECT_EQ(
      summarized(all_of({runs_in_bin(0, 10, 0), runs_in_bin(1, 10, 0), runs_in_bin(2, 10, 0)}), false).capture_range_mm,
      3);
  // A bin beyond it that succeeds does not count.
  EXPECT_EQ(
      summarized(all_of({runs_in_bin(0, 10, 0), runs_in_bin(1, 9, 1), runs_in_bin(2, 10, 0)}), false).capture_range_mm,
      1);
  // 95 % are enough.
  EXPECT_EQ(summarized(all_of({runs_in_bin(0, 19, 1), runs_in_bin(1, 18, 2)}), false).capture_range_mm, 1);
  EXPECT_EQ(summarized(runs_in_bin(0, 0, 10), false).capture_range_mm, 0);
  // In whatever order they ended.
  EXPECT_EQ(
      summarized(all_of({runs_in_bin(2, 5, 5), runs_in_bin(0, 10, 0), runs_in_bin(1, 10, 0)}), false).capture_range_mm,
      2);
}

TEST(EvaluationSummary, CaptureRangeIsABoundWhereTheNextStartsWereNotTried) {
  EXPECT_TRUE(summarized(all_of({runs_in_bin(0, 10, 0), runs_in_bin(1, 10, 0)}), false).may_capture_more);
  EXPECT_TRUE(summarized(all_of({runs_in_bin(0, 10, 0), runs_in_bin(2, 0, 10)}), false).may_capture_more);
  EXPECT_FALSE(summarized(all_of({runs_in_bin(0, 10, 0), runs_in_bin(1, 9, 1)}), false).may_capture_more);
}

TEST(EvaluationSummary, BinsCountRunsAndSuccesses) {
  const auto bins = success_bins(all_of({runs_in_bin(3, 4, 1), runs_in_bin(0, 2, 0)}), false);
  ASSERT_EQ(bins.size(), 2U);
  EXPECT_EQ(bins[0].start_mm, 0);
  EXPECT_EQ(bins[0].runs, 2);
  EXPECT_EQ(bins[0].successes, 2);
  EXPECT_EQ(bins[1].start_mm, 3);
  EXPECT_EQ(bins[1].runs, 5);
  EXPECT_EQ(bins[1].successes, 4);
}

TEST(EvaluationSummary, RotationShareIsOfFailuresOnly) {
  std::vector<EvaluatedRun> runs = {run_with(1, 0.3), run_with(1, 8.0), run_with(1, 9.0)};
  runs[0].rotation_share = 1.0;
  runs[1].rotation_share = 0.2;
  runs[2].rotation_share = 0.6;
  EXPECT_NEAR(summarized(runs, false).rotation_share_of_failures, 0.4, 1e-12);
}

TEST(EvaluationSummary, CountsWhatWasAcceptedRightlyAndWrongly) {
  const std::vector<EvaluatedRun> runs = {
      run_with(1, 0.3, Verdict::kAccepted), run_with(1, 0.4, Verdict::kAccepted), run_with(1, 0.5, Verdict::kReview),
      run_with(1, 1.5, Verdict::kAccepted),  // neither right nor wrong
      run_with(1, 5.0, Verdict::kAccepted), run_with(1, 6.0, Verdict::kRejected), run_with(1, 7.0, Verdict::kReview)};
  const EvaluationSummary summary = summarized(runs, false);
  EXPECT_EQ(summary.within_1_mm, 3);
  EXPECT_EQ(summary.within_1_mm_accepted, 2);
  EXPECT_EQ(summary.beyond_2_mm, 3);
  EXPECT_EQ(summary.beyond_2_mm_accepted, 1);
}

TEST(EvaluationSummary, CoverageIsTheShareOfErrorsWithinSigma) {
  std::vector<EvaluatedRun> runs(5, run_with(1, 0.5));
  EXPECT_FALSE(summarized(runs, false).within_one_sigma);
  // x: errors of 0.5, 1.5, -1.5 and 3 sigma; z: all beyond two. The fifth run gave no sigma and does not count.
  const std::array x_errors = {0.1, 0.3, -0.3, 0.6};
  for (std::size_t n = 0; n < 4; ++n) {
    runs[n].sigma = {0.2, 0.2, 0.2, 1.0, 1.0, 1.0};
    runs[n].error = {x_errors[n], 0.0, 0.5, 0.0, 0.0, -1.7};
  }
  const EvaluationSummary summary = summarized(runs, false);
  ASSERT_TRUE(summary.within_one_sigma && summary.within_two_sigma);
  EXPECT_THAT(*summary.within_one_sigma, testing::ElementsAre(0.25, 1.0, 0.0, 1.0, 1.0, 0.0));
  EXPECT_THAT(*summary.within_two_sigma, testing::ElementsAre(0.75, 1.0, 0.0, 1.0, 1.0, 1.0));
}

TEST(EvaluationSummary, OfBodiesIsByName) {
  const auto body = [](const char* name, bool is_determined, double found_mm, double true_mm) {
    return EvaluatedBody{.name = name,
                         .is_determined = is_determined,
                         .found_mm = {found_mm, 0, 0},
                         .true_mm = {true_mm, 0, 0},
                         .sigma_mm = {0.5, 0, 0}};
  };
  const std::vector<EvaluatedRun> runs = {{.bodies = {body("skull", true, 2.0, 2.4), body("jaw", false, 0.0, 9.0)}},
                                          {.bodies = {body("skull", true, 3.0, 2.1)}},
                                          {.bodies = {body("skull", true, 4.0, 2.0)}}};
  const std::vector<BodySummary> bodies = summarized(runs, false).bodies;
  ASSERT_EQ(bodies.size(), 2U);
  EXPECT_EQ(bodies[0].name, "skull");
  EXPECT_EQ(bodies[0].runs, 3);
  EXPECT_EQ(bodies[0].determined, 3);
  EXPECT_NEAR(bodies[0].median_true_mm, 2.1, 1e-12);
  EXPECT_NEAR(bodies[0].median_error_mm, 0.9, 1e-12);
  EXPECT_NEAR(bodies[0].within_one_sigma, 1.0 / 3.0, 1e-12) << "of x, the axis that has a sigma";
  EXPECT_NEAR(bodies[0].within_two_sigma, 2.0 / 3.0, 1e-12);
  EXPECT_EQ(bodies[1].runs, 1);
  EXPECT_EQ(bodies[1].determined, 0);
}

TEST(EvaluationSummary, OfNoRunsIsEmpty) {
  const EvaluationSummary summary = summarized({}, false);
  EXPECT_EQ(summary.runs, 0);
  EXPECT_EQ(summary.success_share(), 0.0);
  EXPECT_EQ(summary.capture_range_mm, 0);
}

}  // namespace
}  // namespace isoshift::evaluate_test
