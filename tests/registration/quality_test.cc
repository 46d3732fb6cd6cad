#include "registration/quality/judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/drr/test_views.h"
#include "tests/support/pose_near.h"

namespace isoshift {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

RegistrationResult good_result() {
  RegistrationResult result;
  result.views = {{.similarity_start = 0.8, .similarity_final = 0.97},
                  {.similarity_start = 0.7, .similarity_final = 0.95}};
  result.stages = {{.name = "fine", .similarity = "gradient-correlation", .evaluations = 40}};
  return result;
}

constexpr std::array kInside = {1.0, -2.0, 3.0, 0.01, 0.02, -0.03};

TEST(Quality, AcceptsWhatImprovedAndMatchesAndWarnsThatChecksAreIncomplete) {
  RegistrationResult result = good_result();
  judge(kInside, {}, result);
  EXPECT_EQ(result.verdict, Verdict::kAccepted);
  EXPECT_THAT(result.warnings, ElementsAre(HasSubstr("not complete")));
}

TEST(Quality, AParameterAtItsBoundNeedsReview) {
  RegistrationResult result = good_result();
  auto parameters = kInside;
  parameters[1] = -50.0;
  judge(parameters, {}, result);
  EXPECT_EQ(result.verdict, Verdict::kReview);
  EXPECT_THAT(result.reasons, ElementsAre("the y translation ended at its bound"));
}

TEST(Quality, SplattingNeedsReview) {
  RegistrationResult result = good_result();
  result.renderer = RendererKind::kSplatTexture;
  judge(kInside, {}, result);
  EXPECT_EQ(result.verdict, Verdict::kReview);
  EXPECT_THAT(result.reasons, ElementsAre(HasSubstr("splat-texture are too noisy")));
}

TEST(Quality, AViewThatGotWorseNeedsReview) {
  RegistrationResult result = good_result();
  result.views[1] = {.similarity_start = 0.96, .similarity_final = 0.95};
  judge(kInside, {}, result);
  EXPECT_EQ(result.verdict, Verdict::kReview);
  EXPECT_THAT(result.reasons, ElementsAre(HasSubstr("view 2 matches worse")));
}

TEST(Quality, ASearchThatRanOutOfEvaluationsNeedsReview) {
  RegistrationResult result = good_result();
  result.stages.back().reached_limit = true;
  judge(kInside, {}, result);
  EXPECT_THAT(result.reasons, ElementsAre(HasSubstr("did not converge")));
}

TEST(Quality, ASimilarityThatIsNoNumberNeedsReview) {
  RegistrationResult result = good_result();
  result.views[0].similarity_final = std::numeric_limits<double>::quiet_NaN();
  judge(kInside, {}, result);
  EXPECT_EQ(result.verdict, Verdict::kReview);
}

TEST(Quality, ALittleLessInOneViewIsNoise) {
  RegistrationResult result = good_result();
  result.views[1] = {.similarity_start = 0.952, .similarity_final = 0.95};
  judge(kInside, {}, result);
  EXPECT_EQ(result.verdict, Verdict::kAccepted);
}

TEST(Quality, APoorMatchNeedsReview) {
  RegistrationResult result = good_result();
  result.views[0] = result.views[1] = {.similarity_start = 0.6, .similarity_final = 0.75};
  judge(kInside, {}, result);
  EXPECT_EQ(result.verdict, Verdict::kReview);
  EXPECT_THAT(result.reasons, ElementsAre(HasSubstr("0.750 is below 0.80")));
}

TEST(Quality, OneViewCannotSeeDepth) {
  const std::array one = {centered_view(30, 10, 1.0)};
  const auto unobservable = unobservable_directions(one);
  ASSERT_EQ(unobservable.size(), 1U);
  EXPECT_NEAR(std::abs(unobservable[0].dot(one[0].source_room_mm.normalized())), 1.0, 1e-12);
  RegistrationResult result = good_result();
  result.unobservable_room = unobservable;
  judge(kInside, {}, result);
  EXPECT_EQ(result.verdict, Verdict::kReview);
}

TEST(Quality, OpposedViewsSeeNoDepthEither) {
  const std::array opposed = {centered_view(0, 10, 1.0), centered_view(180, 10, 1.0)};
  const auto unobservable = unobservable_directions(opposed);
  ASSERT_EQ(unobservable.size(), 1U);
  EXPECT_NEAR(std::abs(unobservable[0].z()), 1.0, 1e-12);
}

TEST(Quality, ViewsThirtyDegreesApartSeeAllAxes) {
  const std::array apart = {centered_view(0, 10, 1.0), centered_view(31, 10, 1.0)};
  EXPECT_TRUE(unobservable_directions(apart).empty());
  const std::array close = {centered_view(0, 10, 1.0), centered_view(29, 10, 1.0)};
  EXPECT_EQ(unobservable_directions(close).size(), 1U);
  const std::array around = {centered_view(0, 10, 1.0), centered_view(20, 10, 1.0), centered_view(340, 10, 1.0)};
  EXPECT_TRUE(unobservable_directions(around).empty());  // the outer two are 40 degrees apart
}

}  // namespace
}  // namespace isoshift
