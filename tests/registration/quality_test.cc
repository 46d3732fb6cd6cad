#include "registration/quality/findings.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <limits>

#include "geometry/rotation.h"
#include "tests/drr/test_views.h"
#include "tests/support/pose_near.h"

namespace isoshift::quality_test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;

ViewConsistency parts(int agreeing, int disagreeing, int without_signal = 0) {
  ViewConsistency consistency;
  for (int n = 0; n < agreeing; ++n) consistency.parts.push_back({.has_signal = true});
  for (int n = 0; n < disagreeing; ++n) consistency.parts.push_back({.has_signal = true, .disagrees = true});
  for (int n = 0; n < without_signal; ++n) consistency.parts.push_back({});
  return consistency;
}

// Everything as it should be: 0.2 mm and 0.2 degrees at one sigma, and mirrored images that explain much less.
RegistrationResult good_result() {
  RegistrationResult result;
  result.views = {{.similarity_start = 0.8, .similarity_final = 0.97, .consistency = parts(20, 0)},
                  {.similarity_start = 0.7, .similarity_final = 0.95, .consistency = parts(20, 0)}};
  result.stages = {{.name = "restarts",
                    .similarity = "gradient-correlation",
                    .evaluations = 90,
                    .spread_mm = 0.1,
                    .spread_rad = rad_from_deg(0.1)},
                   {.name = "fine", .similarity = "gradient-correlation", .evaluations = 40}};
  result.uncertainty =
      uncertainty_of_independent_axes(Eigen::Vector3d::Constant(0.2), Eigen::Vector3d::Constant(rad_from_deg(0.2)));
  result.alternatives = {
      {.description = "view 1 mirrored", .similarity = 0.6, .as_is = 0.96, .distance_mm = 9.0},
      {.description = "views 1 and 2 exchanged", .similarity = 0.3, .as_is = 0.96, .angle_rad = 0.5}};
  return result;
}

constexpr std::array kInside = {1.0, -2.0, 3.0, 0.01, 0.02, -0.03};

// Spoils a good result, and expects review for this one reason.
void expect_review(const std::function<void(RegistrationResult&)>& spoil, const std::string& reason) {
  RegistrationResult result = good_result();
  spoil(result);
  result.findings = findings_about(kInside, {}, result);
  EXPECT_EQ(result.verdict(), Verdict::kReview) << reason;
  EXPECT_THAT(result.reasons(), ElementsAre(HasSubstr(reason)));
}

void expect_accepted(const std::function<void(RegistrationResult&)>& change) {
  RegistrationResult result = good_result();
  change(result);
  result.findings = findings_about(kInside, {}, result);
  EXPECT_EQ(result.verdict(), Verdict::kAccepted) << testing::PrintToString(result.reasons());
  EXPECT_THAT(result.reasons(), testing::IsEmpty());
}

TEST(Quality, AcceptsWhatImprovedAndMatches) {
  expect_accepted([](RegistrationResult&) {});
}

TEST(Quality, EveryViewMustMatch) {
  expect_review([](RegistrationResult& r) { r.views[1].similarity_start = 0.1, r.views[1].similarity_final = 0.39; },
                "view 2 hardly matches (gradient correlation 0.390)");
}

TEST(Quality, TooLittleToCheckForMovedAnatomyNeedsReview) {
  for (const ViewConsistency& few : {parts(0, 0), parts(1, 0, 12), parts(0, 1, 3)})
    expect_review([&](RegistrationResult& r) { r.views[0].consistency = few; }, "too little of view 1 is compared");
  expect_accepted([](RegistrationResult& r) { r.views[0].consistency = parts(2, 0); });
}

// Of bodies: whether the target is seen, straight, and surrounded by what the CT shows.
TEST(Quality, SurroundingsOfTheTargetThatMatchPoorlyNeedAReview) {
  const auto bent = [](TargetMatch match, double image_share, double deformation_mm) {
    return [=](RegistrationResult& result) {
      result.bodies.assign(3, {.image_share = 0.9});
      result.bodies[0].vertebra = 0;
      result.bodies[0].carries_target = 0.9;
      result.target_match = match;
      result.target_image_share = image_share;
      result.target_deformation_mm = deformation_mm;
    };
  };
  expect_accepted(bent({0.92, 0.75}, 0.6, 1.0));
  const std::string poorly = "the target's surroundings match poorly";
  expect_review(bent({0.89, 0.95, 0.85, 0.94}, 0.6, 1.0), poorly);
  expect_review(bent({0.95, 0.65, 0.85, 0.94}, 0.6, 1.0), poorly);
  expect_review(bent({std::nan(""), 0.95}, 0.6, 1.0), poorly);
  // On coarse images only coarse pixels can match, and of those most parts where contrast has changed.
  expect_accepted(bent({0.8, 0.8, 0.87, 0.9}, 0.6, 1.0));
  expect_accepted(bent({0.8, 0.8, 0.6, 0.96}, 0.6, 1.0));
  expect_review(bent({0.79, 0.8, 0.6, 0.96}, 0.6, 1.0), poorly);
  // A part of a group of bones may have moved by itself, and may be what is trimmed away.
  const auto by_other_bones = [&](TargetMatch match) {
    return [=](RegistrationResult& result) {
      bent(match, 0.6, 1.0)(result);
      result.bodies[0].vertebra.reset();
    };
  };
  expect_review(by_other_bones({0.95, 0.95, 0.8, 0.9}), poorly);
  expect_review(by_other_bones({0.95, 0.95, 0.88, 0.93}), poorly);
  expect_accepted(by_other_bones({0.95, 0.95, 0.87, 0.94}));
  expect_accepted(by_other_bones({0.7, 0.7, 0.8, 0.96}));
  expect_review(bent({0.95, 0.95, 0.9, 0.9}, 0.2, 1.0), "the images hardly show the bodies that carry the target");
  expect_review(bent({0.95, 0.95, 0.9, 0.9}, 0.6, 2.5), "the target itself is bent");
}

// One that is nearly straight fits where it has slid along, too.
TEST(Quality, ABoneThatNoOtherConfirmsNeedsAReview) {
  const auto with_determined = [](std::size_t count) {
    return [=](RegistrationResult& result) {
      result.bodies.assign(4, {.image_share = 0.0});
      for (std::size_t n = 0; n < count; ++n) result.bodies[n].image_share = 0.9;
      result.target_match = {.of_all = 0.95, .of_parts = 0.94};
      result.target_image_share = 0.6;
    };
  };
  expect_accepted(with_determined(2));
  expect_review(with_determined(1), "nothing confirms where it lies");
}

TEST(Quality, ViewsThatContradictEachOtherNeedReview) {
  expect_review(
      [](RegistrationResult& r) { r.views[0].contradiction = {0.9, 0.1}, r.views[1].contradiction = {0.4, 0.1}; },
      "the views contradict each other: each of them alone would want the anatomy elsewhere, 0.7 mm in the");
  expect_review([](RegistrationResult& r) { r.views[1].contradiction = {std::nan(""), 0.1}; }, "contradict each other");
  expect_accepted(
      [](RegistrationResult& r) { r.views[0].contradiction = {0.2, 0.1}, r.views[1].contradiction = {0.3, 0.1}; });
  // Coarse voxels and noise let more be expected.
  expect_accepted(
      [](RegistrationResult& r) { r.views[0].contradiction = {0.9, 0.4}, r.views[1].contradiction = {0.4, 0.1}; });
}

TEST(Quality, ViewsThatTurnThePatientAgainstEachOtherNeedReview) {
  const auto with_turn = [](double degrees, double sigma_degrees) {
    return [=](RegistrationResult& r) {
      r.turn = {.angle_rad = rad_from_deg(degrees), .sigma_rad = rad_from_deg(sigma_degrees)};
    };
  };
  expect_review(with_turn(2.0, 0.3), "patient turned, by 2.0 degrees against the other");
  expect_review(with_turn(std::nan(""), 0.3), "the views contradict each other");
  expect_accepted(with_turn(0.6, 0.1));
  expect_accepted(with_turn(2.0, 0.8));
  // Bones that are free to move explain it better, or do not.
  const auto with_bodies = [&](double share) {
    return [=](RegistrationResult& r) {
      with_turn(2.0, 0.3)(r);
      r.turn.share_of_bodies_gain = share;
      r.bodies.assign(2, {.sigma_mm = Eigen::Vector3d::Constant(0.3), .image_share = 0.9});
      r.target_match = {.of_all = 0.95, .of_parts = 0.94};
      r.target_image_share = 0.6;
    };
  };
  expect_accepted(with_bodies(0.1));
  expect_review(with_bodies(0.6), "patient turned, by 2.0 degrees against the other");
}

TEST(Quality, GeometryThatExplainsWhatBodiesWouldNeedsReview) {
  const auto apart = [](double gain, double share) {
    return [=](RegistrationResult& r) {
      r.apart = {.gain = gain, .share_of_bodies_gain = share};
      r.bodies.assign(2, {.sigma_mm = Eigen::Vector3d::Constant(0.3), .image_share = 0.9});
      r.target_match = {.of_all = 0.95, .of_parts = 0.94};
      r.target_image_share = 0.6;
    };
  };
  expect_review(apart(60.0, 1.1), "a patient who lies elsewhere in each of them explains as much as bones");
  expect_review(apart(std::nan(""), 1.1), "the views contradict each other");
  expect_accepted(apart(200.0, 0.5));
  expect_accepted(apart(4.0, 1.2));
}

TEST(Quality, AnExclusionThatCannotBeKeptNeedsReview) {
  expect_review([](RegistrationResult& r) { r.views[0].has_all_excluded = false; },
                "what is excluded covers nearly all that view 1 shows");
}

TEST(Quality, AFieldThatIsNotSureNeedsReview) {
  expect_review([](RegistrationResult& r) { r.views[1].field.doubt = "its left edge is faint"; },
                "the irradiated field of view 2 is not sure: its left edge is faint");
}

TEST(Quality, AParameterAtItsBoundNeedsReview) {
  constexpr std::array kNames = {"x translation",    "y translation",    "z translation",
                                 "rotation about x", "rotation about y", "rotation about z"};
  const RegistrationOptions options{{.bound_mm = 20.0, .bound_rad = 0.2}};
  for (std::size_t axis = 0; axis < kInside.size(); ++axis)
    for (const double sign : {-1.0, 1.0}) {
      RegistrationResult result = good_result();
      auto parameters = kInside;
      parameters[axis] = sign * 20.0;  // 0.2 rad on the sphere of 100 mm is 20 mm, too
      result.findings = findings_about(parameters, options, result);
      EXPECT_EQ(result.verdict(), Verdict::kReview);
      EXPECT_THAT(result.reasons(), ElementsAre(fmt::format("the {} ended at its bound", kNames[axis])));
    }
}

void set_sigma(RegistrationResult& result, int axis, double sigma) {
  result.uncertainty->covariance(axis, axis) = sigma * sigma;
}

TEST(Quality, EveryAxisMustBeKnownToAMillimeterAndADegreeAtTwoSigma) {
  for (int axis = 0; axis < 3; ++axis) {
    expect_accepted([&](RegistrationResult& result) {
      set_sigma(result, axis, 0.49);
      set_sigma(result, axis + 3, rad_from_deg(0.49));
    });
    const std::string name(1, "xyz"[axis]);
    expect_review([&](RegistrationResult& result) { set_sigma(result, axis, 0.6); },
                  "the target is uncertain along " + name + ": 1.2 mm at two sigma");
    expect_review([&](RegistrationResult& result) { set_sigma(result, axis + 3, rad_from_deg(0.6)); },
                  "the rotation about " + name + " is uncertain: 1.2 degrees at two sigma");
  }
}

// Rotations of 0.4 degrees at one sigma are 0.7 mm at 100 mm. Where translation and rotation err together, as those of
// bones about a target do, the isocenter may be uncertain and the target certain.
TEST(Quality, TheUncertaintyThatCountsIsThatOfTheTarget) {
  RegistrationOptions options;
  options.target_patient_mm = {0.0, 0.0, 100.0};
  RegistrationResult result = good_result();
  result.actual_room_from_patient.translation() = Eigen::Vector3d(3.0, -2.0, 1.0);
  for (int axis = 3; axis < 6; ++axis) set_sigma(result, axis, rad_from_deg(0.4));
  const RegistrationResult independent = result;
  result.findings = findings_about(kInside, options, result);
  EXPECT_EQ(result.verdict(), Verdict::kReview);
  EXPECT_THAT(result.reasons(), Contains(HasSubstr("the target is uncertain along y: 1.5 mm at two sigma")));

  const Eigen::Vector3d found_mm = result.actual_room_from_patient * *options.target_patient_mm;
  Eigen::Matrix<double, 6, 6> about_target = Eigen::Matrix<double, 6, 6>::Identity();
  about_target.topRightCorner<3, 3>() = cross_matrix(found_mm);
  result = independent;
  result.uncertainty->covariance = about_target * independent.uncertainty->covariance * about_target.transpose();
  EXPECT_GT(result.uncertainty->sigma_translation_mm().y(), 0.5);
  EXPECT_LT((result.uncertainty->sigma_at_mm(found_mm) - independent.uncertainty->sigma_translation_mm()).norm(), 1e-9);
  result.findings = findings_about(kInside, options, result);
  EXPECT_EQ(result.verdict(), Verdict::kAccepted);
  result.findings = findings_about(kInside, {}, result);
  EXPECT_EQ(result.verdict(), Verdict::kReview);
}

TEST(Quality, AnUncertaintyThatIsMissingOrNoNumberNeedsReview) {
  expect_review([](RegistrationResult& result) { result.uncertainty.reset(); }, "the images do not determine the pose");
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const int axis : {1, 5}) {
    RegistrationResult result = good_result();
    set_sigma(result, axis, kNan);
    result.findings = findings_about(kInside, {}, result);
    EXPECT_EQ(result.verdict(), Verdict::kReview);
    EXPECT_THAT(result.reasons(), Each(AllOf(HasSubstr("is uncertain"), HasSubstr("nan"))));
  }
}

TEST(Quality, StartsThatEndApartNeedReview) {
  const auto spread = [](double mm, double deg) {
    return [=](RegistrationResult& result) {
      result.stages[0].spread_mm = mm;
      result.stages[0].spread_rad = rad_from_deg(deg);
    };
  };
  expect_accepted(spread(0.95, 0.95));
  expect_review(spread(1.2, 0.1), "end 1.2 mm and 0.1 degrees apart in stage restarts");
  expect_review(spread(0.1, 1.2), "end 0.1 mm and 1.2 degrees apart in stage restarts");
  expect_review(spread(std::numeric_limits<double>::infinity(), 0.0), "searches from different starts");
}

TEST(Quality, SplattingNeedsReview) {
  expect_review([](RegistrationResult& result) { result.renderer = "splat-texture"; }, "splat-texture are too noisy");
}

TEST(Quality, AViewThatGotWorseNeedsReview) {
  for (const std::size_t view : {0U, 1U})
    expect_review(
        [&](RegistrationResult& result) {
          result.views[view].similarity_start = 0.99;
          result.views[view].similarity_final = 0.94;
        },
        fmt::format("view {} matches worse", view + 1));
}

TEST(Quality, ALittleLessInOneViewIsNoise) {
  expect_accepted([](RegistrationResult& result) { result.views[1].similarity_start = 0.951; });
}

TEST(Quality, ASearchThatRanOutOfEvaluationsNeedsReview) {
  expect_review([](RegistrationResult& result) { result.stages.back().reached_limit = true; }, "did not converge");
  expect_review([](RegistrationResult& result) { result.stages.clear(); }, "did not converge");
}

TEST(Quality, ASimilarityThatIsNoNumberIsNeverAccepted) {
  RegistrationResult result = good_result();
  result.views[0].similarity_final = std::numeric_limits<double>::quiet_NaN();
  result.findings = findings_about(kInside, {}, result);
  EXPECT_NE(result.verdict(), Verdict::kAccepted);
}

TEST(Quality, TheWorseTheMatchTheWorseTheVerdict) {
  const auto verdict_at = [](double similarity) {
    RegistrationResult result = good_result();
    for (ViewMatch& view : result.views)
      view = {.similarity_start = 0.0, .similarity_final = similarity, .consistency = parts(20, 0)};
    result.findings = findings_about(kInside, {}, result);
    EXPECT_EQ(result.reasons().empty(), result.verdict() == Verdict::kAccepted) << similarity;
    return result.verdict();
  };
  EXPECT_EQ(verdict_at(0.97), Verdict::kAccepted);
  EXPECT_EQ(verdict_at(0.02), Verdict::kRejected);
  Verdict last = Verdict::kAccepted;
  int changes = 0;
  for (int percent = 97; percent > 0; --percent) {
    const Verdict verdict = verdict_at(0.01 * percent);
    EXPECT_GE(verdict, last) << percent;
    changes += verdict != last ? 1 : 0;
    last = verdict;
  }
  EXPECT_EQ(changes, 2);  // there is review in between
}

TEST(Quality, PartsThatDisagreeNeedReview) {
  for (const std::size_t view : {0U, 1U})
    expect_review([&](RegistrationResult& result) { result.views[view].consistency = parts(10, 10, 5); },
                  fmt::format("10 of 20 parts of view {} match elsewhere", view + 1));
  // Of many parts, a smaller share: one place is in up to four of them.
  expect_accepted([](RegistrationResult& result) { result.views[0].consistency = parts(74, 3); });
  expect_review([](RegistrationResult& result) { result.views[0].consistency = parts(73, 4); }, "4 of 77 parts");
  expect_accepted([](RegistrationResult& result) { result.views[0].consistency = parts(196, 6); });
  expect_review([](RegistrationResult& result) { result.views[0].consistency = parts(193, 7); }, "7 of 200 parts");
  // One alone may be anything, and parts without a signal say nothing.
  expect_accepted([](RegistrationResult& result) { result.views[0].consistency = parts(1, 1); });
  expect_accepted([](RegistrationResult& result) { result.views[0].consistency = parts(2, 0, 30); });
}

TEST(Quality, MorePartsMayDisagreeWhereAVolumeIsChosen) {
  RegionOfInterest region{.volume = Volume<std::uint8_t>({4, 4, 4}, Eigen::Affine3d::Identity())};
  region.volume->at(1, 1, 1) = 1;
  const auto chosen = std::make_shared<const ProjectedRegion>(region);
  RegistrationResult result = good_result();
  result.views[0].consistency = parts(45, 5);
  result.findings = findings_about(kInside, {.region = chosen}, result);
  EXPECT_EQ(result.verdict(), Verdict::kAccepted);
  result.findings = findings_about(kInside, {}, result);
  EXPECT_EQ(result.verdict(), Verdict::kReview);
}

TEST(Quality, AnAlternativeThatIsBetterNeedsReviewWhereverItLies) {
  const auto mirrored = [](double similarity, double distance_mm) {
    return [=](RegistrationResult& result) {
      result.alternatives[0].similarity = similarity;
      result.alternatives[0].distance_mm = distance_mm;
    };
  };
  expect_review(mirrored(0.99, 9.0), "with view 1 mirrored the images match better (0.990; as they are 0.960)");
  expect_review(mirrored(0.99, 0.0), "view 1 mirrored");
}

TEST(Quality, AnAlternativeAsGoodNeedsReviewUnlessItMeansTheSamePose) {
  const auto exchanged = [](double similarity, double distance_mm, double angle_deg) {
    return [=](RegistrationResult& result) {
      Alternative& alternative = result.alternatives[1];
      alternative.similarity = similarity;
      alternative.distance_mm = distance_mm;
      alternative.angle_rad = rad_from_deg(angle_deg);
    };
  };
  expect_review(exchanged(0.96, 5.0, 0.0), "views 1 and 2 exchanged the images match as well");
  expect_review(exchanged(0.96, 0.0, 5.0), "5.0 degrees away");
  expect_review(exchanged(std::numeric_limits<double>::quiet_NaN(), 5.0, 0.0), "views 1 and 2 exchanged");
  expect_accepted(exchanged(0.96, 0.5, 0.5));
  expect_accepted(exchanged(0.5, 50.0, 50.0));  // another pose, but not as good
}

TEST(Quality, APresetWithoutTheCheckOfAlternativesNeedsReview) {
  RegistrationResult result = good_result();
  result.alternatives.clear();
  result.findings = findings_about(kInside, {.check_alternatives = false}, result);
  EXPECT_EQ(result.verdict(), Verdict::kReview);
  EXPECT_THAT(result.reasons(), ElementsAre(HasSubstr("leaves out the check")));
}

TEST(Quality, AViewThatPullsThePoseNeedsReview) {
  const auto without_second_view = [](double mm, double deg) {
    return [=](RegistrationResult& result) {
      result.views[0].left_out = LeftOutView{.distance_mm = 0.1, .angle_rad = 0.0};
      result.views[1].left_out = LeftOutView{.distance_mm = mm, .angle_rad = rad_from_deg(deg)};
    };
  };
  expect_accepted(without_second_view(0.9, 0.9));
  expect_review(without_second_view(1.4, 0.1), "without view 2 the pose lies 1.4 mm and 0.1 degrees away");
  expect_review(without_second_view(0.1, 1.4), "without view 2 the pose lies 0.1 mm and 1.4 degrees away");
}

TEST(Quality, EveryReasonIsGivenAndTheWorstDecides) {
  RegistrationResult result = good_result();
  result.views[0].similarity_start = result.views[0].similarity_final = 0.01;
  result.views[1].similarity_start = result.views[1].similarity_final = 0.01;
  result.uncertainty.reset();
  result.stages[1].reached_limit = true;
  result.findings = findings_about(kInside, {}, result);
  EXPECT_EQ(result.verdict(), Verdict::kRejected);
  EXPECT_THAT(result.reasons(), testing::UnorderedElementsAre(HasSubstr("did not converge"), HasSubstr("0.010"),
                                                              HasSubstr("do not determine the pose")));
}

TEST(Quality, OneViewCannotSeeDepth) {
  const std::array one = {centered_view(30, 10, 1.0)};
  const auto unobservable = unobservable_directions(one);
  ASSERT_EQ(unobservable.size(), 1U);
  EXPECT_NEAR(std::abs(unobservable[0].dot(one[0].source_room_mm.normalized())), 1.0, 1e-12);
  RegistrationResult result = good_result();
  result.unobservable_room = unobservable;
  result.findings = findings_about(kInside, {}, result);
  EXPECT_EQ(result.verdict(), Verdict::kReview);
  EXPECT_THAT(result.reasons(), ElementsAre(HasSubstr("nearly the same direction")));
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
  const std::array from_both_sides = {centered_view(0, 10, 1.0), centered_view(150, 10, 1.0)};
  EXPECT_TRUE(unobservable_directions(from_both_sides).empty());
  const std::array close = {centered_view(0, 10, 1.0), centered_view(29, 10, 1.0)};
  EXPECT_EQ(unobservable_directions(close).size(), 1U);
  const std::array around = {centered_view(0, 10, 1.0), centered_view(20, 10, 1.0), centered_view(340, 10, 1.0)};
  EXPECT_TRUE(unobservable_directions(around).empty());  // the outer two are 40 degrees apart
}

}  // namespace
}  // namespace isoshift::quality_test
