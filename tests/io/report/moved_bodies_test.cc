// What bones did against the target, as people read it.

#include "io/report/moved_bodies.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/report/formats.h"
#include "tests/support/oblique_report.h"

namespace isoshift::moved_bodies_test {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string words_of(const SetupResult& report) { return bent_words(shown_shift(report), LengthUnit::kMm); }

std::vector<ReportPage::Row> rows_of(const SetupResult& report) {
  return moved_section(shown_shift(report), report.structures, LengthUnit::kMm).rows;
}

TEST(MovedBodies, TheFarthestAndTheMostTurnedBoneAreNamed) {
  EXPECT_EQ(words_of(bent_report(Verdict::kAccepted)),
            "Once the target is right, vertebra 3 toward the feet lies 9.2 mm off (to the left); vertebra 2 "
            "toward the head is tilted backward by 4.0 deg against it");
}

TEST(MovedBodies, TheSpineIsToldOnBothSidesOfTheTarget) {
  SetupResult report = bent_report(Verdict::kAccepted);
  report.bodies[0].vertebra = -3;
  report.bodies[1].vertebra = 0;
  report.bodies[2].vertebra = 2;
  EXPECT_EQ(words_of(report),
            "Once the target is right, toward the head the spine is tilted backward by 4.0 deg over 2 vertebrae");
  report.bodies[0].rotation_rad = {0.0, 0.06, 0.0};  // about the room's y: toward the head
  EXPECT_EQ(words_of(report),
            "Once the target is right, toward the head the spine is tilted backward by 4.0 deg over 2 vertebrae, "
            "toward the feet the spine is turned to the left by 3.4 deg over 3 vertebrae");
}

TEST(MovedBodies, ABoneThatIsBothIsNamedOnce) {
  SetupResult report = bent_report(Verdict::kAccepted);
  report.bodies[0].name = "right bones 60 mm toward the feet";
  report.bodies[0].rotation_rad = {0.0, 0.1, 0.0};  // about the room's y: toward the head
  EXPECT_EQ(words_of(report),
            "Once the target is right, the right bones 60 mm toward the feet lie 9.2 mm off (to the left) and are "
            "turned to the left by 5.7 deg");
}

TEST(MovedBodies, WaysAreThoseOfThePatientHoweverHeLies) {
  SetupResult report = bent_report(Verdict::kAccepted);
  const auto words = [&](const char* position) {
    report.patient_position = position;
    return words_of(report);
  };
  EXPECT_THAT(words("HFS"), HasSubstr("(to the left)"));
  EXPECT_THAT(words("HFP"), HasSubstr("(to the right)"));
  EXPECT_THAT(words("FFS"), HasSubstr("(to the right)"));
  EXPECT_THAT(words("unknown"), HasSubstr("lies 9.2 mm off; vertebra 2"));
}

TEST(MovedBodies, SmallMotionsAreNotToldAsMotions) {
  SetupResult report = bent_report(Verdict::kAccepted);
  for (BodyMotion& body : report.bodies) {
    body.displacement_mm *= 0.1;
    body.rotation_rad *= 0.1;
  }
  EXPECT_EQ(words_of(report),
            "Once the target is right, no bone that is determined lies more than 2.0 mm off or is turned by more than "
            "2 deg");
}

TEST(MovedBodies, WhatIsNotDeterminedOrBreathesIsNotNamed) {
  SetupResult report = bent_report(Verdict::kAccepted);
  EXPECT_THAT(words_of(report), Not(HasSubstr("bones")));
  for (BodyMotion& body : report.bodies) body.image_share = 0.0;
  EXPECT_EQ(words_of(report), "What the other bones did against the target is not determined");
}

TEST(MovedBodies, WhatCarriesTheTargetSaysNothingOfTheOthers) {
  SetupResult report = bent_report(Verdict::kAccepted);
  for (BodyMotion& body : report.bodies)
    if (!(body.carries_target > 0.0)) body.image_share = 0.0;
  EXPECT_EQ(words_of(report), "What the other bones did against the target is not determined");
}

TEST(MovedBodies, TheTableBeginsAtTheTarget) {
  const std::vector<ReportPage::Row> rows = rows_of(bent_report(Verdict::kAccepted));
  ASSERT_EQ(rows.size(), 8U);
  EXPECT_EQ(rows[1].name, "vertebra nearest to the target");
  EXPECT_EQ(rows[1].value, "0.1 +/- 0.4 mm, to the left; 0.1 deg, tilted forward; carries the target 62 %");
  EXPECT_EQ(rows[2].name, "vertebra 2 toward the head");
  EXPECT_EQ(rows[2].value, "3.0 +/- 0.4 mm, to the front; 4.0 deg, tilted backward");
  EXPECT_EQ(rows[3].value, "12.0 +/- 0.4 mm, to the front; 6.0 deg, turned to the left; breathes");
  EXPECT_EQ(rows[4].name, "vertebra 3 toward the feet");
  EXPECT_EQ(rows[5].value, "not determined");
  EXPECT_EQ(rows[6].name, "Structure Spinal^Cord");
  EXPECT_EQ(rows[6].value, "its center lies 1.3 mm off, its surface 4.3 mm at most, if it goes with the bones near it");
  SetupResult report = bent_report(Verdict::kAccepted);
  report.structures[0].is_determined = false;
  EXPECT_EQ(rows_of(report)[6].value, "not determined");
  EXPECT_EQ(rows[7].value, "what lies off by 1 mm and more, 5 times as long");
}

TEST(MovedBodies, NumbersAreRoundedAsTheirSigmaAllows) {
  SetupResult report = bent_report(Verdict::kAccepted);
  report.bodies[0].sigma_mm.x() = 0.7;
  EXPECT_THAT(words_of(report), HasSubstr("lies 9 mm off"));
  EXPECT_THAT(rows_of(report)[4].value, HasSubstr("9 +/- 2 mm"));
}

TEST(MovedBodies, EveryFormatTellsItDirectlyBehindTheTarget) {
  const SetupResult report = bent_report(Verdict::kReview);
  const ReportPage page = report_page(report);
  EXPECT_EQ(page.who[1].name, "Target");
  EXPECT_EQ(page.who[2].name, kBent);
  for (const std::string& shown :
       {text_report(page), html_report(report, page, std::vector<ViewPngs>(report.views.size()))}) {
    EXPECT_THAT(shown, HasSubstr("vertebra 3 toward the feet lies 9.2 mm off"));
    EXPECT_THAT(shown, HasSubstr("carries the target 62 %"));
    EXPECT_THAT(shown, HasSubstr("its surface lies at most 0.4 mm from where a rigid motion puts it"));
  }
}

TEST(MovedBodies, RejectedResultsAndWholePatientsHaveNone) {
  SetupResult whole = bent_report(Verdict::kAccepted);
  whole.bodies.clear();
  for (const SetupResult& report : {bent_report(Verdict::kRejected), whole}) {
    EXPECT_EQ(words_of(report), "");
    const std::string text = text_report(report_page(report));
    for (const char* words : {"Bent", "WHAT MOVED", "Deformation", "9.2"}) EXPECT_THAT(text, Not(HasSubstr(words)));
  }
}

}  // namespace
}  // namespace isoshift::moved_bodies_test
