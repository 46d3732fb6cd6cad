#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "io/report/setup_report.h"

namespace isoshift {
namespace {

using testing::HasSubstr;
using testing::Not;

// head-oblique at its truth, the worked example of docs/conventions.md.
SetupReport oblique_report(Verdict verdict) {
  SetupReport report;
  report.verdict = verdict;
  report.patient_name = "Example";
  report.patient_position = "HFS";
  report.table.support_rad = rad_from_deg(10.0);
  report.setup_error.translation() = Eigen::Vector3d(-7.4, 3.9, -5.2);
  report.setup_error.linear() = rotation_from_zxy({rad_from_deg(-2.9), rad_from_deg(-2.3), rad_from_deg(1.7)});
  report.views = {{.label = "KV_45", .sop_instance_uid = "1.2", .gantry_deg = 45}};
  return report;
}

TEST(Report, JsonHoldsTheWorkedExample) {
  const auto json = nlohmann::json::parse(json_report(oblique_report(Verdict::kAccepted)));
  EXPECT_NEAR(json["couch_shift"]["lateral_mm"], 6.610, 5e-4);
  EXPECT_NEAR(json["couch_shift"]["longitudinal_mm"], -5.126, 5e-4);
  EXPECT_NEAR(json["couch_shift"]["vertical_mm"], 5.2, 1e-12);
  EXPECT_NEAR(json["couch_shift"]["yaw_deg"], 2.969, 5e-4);
  EXPECT_NEAR(json["couch_shift"]["pitch_deg"], 1.861, 5e-4);
  EXPECT_NEAR(json["couch_shift"]["roll_deg"], -2.172, 5e-4);
  EXPECT_NEAR(json["couch_target_deg"]["yaw"], 12.969, 5e-4);
  EXPECT_NEAR(json["setup_error"]["rotation_deg"]["rx"], -2.3, 1e-9);
  EXPECT_EQ(json["verdict"], "accepted");
}

TEST(Report, TextSaysWhichWayToMove) {
  const std::string text = text_report(oblique_report(Verdict::kAccepted));
  EXPECT_THAT(text, HasSubstr("  Lateral          +6.6 mm   to the right, seen facing the gantry\n"));
  EXPECT_THAT(text, HasSubstr("  Longitudinal     -5.1 mm   away from the gantry\n"));
  EXPECT_THAT(text, HasSubstr("  Vertical         +5.2 mm   up\n"));
  EXPECT_THAT(text, HasSubstr("  Yaw              +3.0 deg  counter-clockwise, seen from above\n"));
  EXPECT_THAT(text, HasSubstr("Not for clinical use unless validated by the site."));
}

TEST(Report, RejectedResultsShowNoShiftInAnyFormat) {
  const SetupReport report = oblique_report(Verdict::kRejected);
  const auto json = nlohmann::json::parse(json_report(report));
  EXPECT_TRUE(json["couch_shift"].is_null());
  EXPECT_TRUE(json["couch_target_deg"].is_null());
  const std::string text = text_report(report);
  EXPECT_THAT(text, HasSubstr("withheld"));
  for (const char* number : {"6.6", "5.1", "5.2", "7.4"}) EXPECT_THAT(text, Not(HasSubstr(number)));
}

TEST(Report, UnobservableComponentsAreNull) {
  SetupReport report = oblique_report(Verdict::kReview);
  // Gantry 45: the view cannot tell along (sin 45, 0, cos 45); at couch 10 that enters all three table axes.
  report.unobservable_room = {Eigen::Vector3d(std::sqrt(0.5), 0, std::sqrt(0.5))};
  const auto json = nlohmann::json::parse(json_report(report));
  EXPECT_TRUE(json["setup_error"]["translation_mm"][0].is_null());
  EXPECT_NEAR(json["setup_error"]["translation_mm"][1], 3.9, 1e-12);
  EXPECT_TRUE(json["setup_error"]["translation_mm"][2].is_null());
  EXPECT_TRUE(json["couch_shift"]["lateral_mm"].is_null());
  EXPECT_TRUE(json["couch_shift"]["longitudinal_mm"].is_null());
  EXPECT_TRUE(json["couch_shift"]["vertical_mm"].is_null());
  EXPECT_THAT(text_report(report), HasSubstr("  Vertical       not determined\n"));
}

TEST(Report, RoundsHalvesAwayFromZeroAndNeverToMinusZero) {
  EXPECT_EQ(rounded(0.25), "+0.3");
  EXPECT_EQ(rounded(-0.25), "-0.3");
  EXPECT_EQ(rounded(-0.04), "0.0");
  EXPECT_EQ(rounded(12.34), "+12.3");
}

TEST(Report, SurvivesNamesThatAreNoText) {
  SetupReport report = oblique_report(Verdict::kAccepted);
  report.patient_name = "Evil\nVERDICT      ACCEPTED\x1b[31m";
  report.views[0].label = "\xff\xfe";
  EXPECT_THAT(text_report(report), Not(HasSubstr("\nVERDICT      ACCEPTED\x1b")));
  EXPECT_NO_THROW(nlohmann::json::parse(json_report(report)));
}

}  // namespace
}  // namespace isoshift
