// What reports say, in every format: the same numbers, rounded once, and no shift where there is none.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <regex>

#include "base/error.h"
#include "base/output_folder.h"
#include "io/report/canvas.h"
#include "io/report/formats.h"
#include "io/report/rounding.h"
#include "setup/shown_shift.h"
#include "tests/support/command.h"
#include "tests/support/oblique_report.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::report_test {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string text_of(const SetupResult& report) { return text_report(report_page(report)); }
std::string html_of(const SetupResult& report) {
  return html_report(report, report_page(report), std::vector<ViewPngs>(report.views.size()));
}

// The text of a PDF, in the order it is read.
std::string text_of_pdf(const SetupResult& report, int last_page = 99) {
  const TemporaryFolder folder;
  write_text(folder / "report.pdf", pdf_report(report, report_page(report)));
  const CommandOutcome outcome =
      run_shell(fmt::format("pdftotext -layout -enc UTF-8 -l {} {} -", last_page, (folder / "report.pdf").string()));
  EXPECT_EQ(outcome.exit_status, 0) << outcome.out;
  return outcome.out;
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (const char c : line) {
    if (c == '"')
      quoted = !quoted;
    else if (c == ',' && !quoted)
      cells.emplace_back();
    else if (c != '\r' && c != '\n')
      cells.back() += c;
  }
  return cells;
}

// Names and values of the one row.
std::map<std::string, std::string> csv_of(const SetupResult& report) {
  const std::string csv = csv_report(report);
  const auto end = csv.find("\r\n");
  const std::vector<std::string> names = cells_of(csv.substr(0, end)), cells = cells_of(csv.substr(end + 2));
  EXPECT_EQ(names.size(), cells.size());
  std::map<std::string, std::string> row;
  for (std::size_t n = 0; n < names.size(); ++n) row[names[n]] = cells[n];
  return row;
}

// The first group of the first match, "" if there is none.
std::string found(const std::string& text, const std::string& pattern) {
  std::smatch match;
  return std::regex_search(text, match, std::regex(pattern)) ? match[1].str() : "";
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
  EXPECT_EQ(json["action"], "unset");
}

TEST(Report, TextSaysWhichWayToMove) {
  const std::string text = text_of(oblique_report(Verdict::kAccepted));
  EXPECT_THAT(text, HasSubstr("  Lateral          +6.6 mm   to the right, seen facing the gantry\n"));
  EXPECT_THAT(text, HasSubstr("  Longitudinal     -5.1 mm   away from the gantry\n"));
  EXPECT_THAT(text, HasSubstr("  Vertical         +5.2 mm   up\n"));
  EXPECT_THAT(text, HasSubstr("  Yaw              +3.0 deg  counter-clockwise, seen from above\n"));
  EXPECT_THAT(text, HasSubstr("Not for clinical use unless validated by the site."));
}

// The numbers of all formats, for many results: equal, and those of result.json rounded once.
TEST(Report, AllFormatsShowTheSameNumbers) {
  std::mt19937_64 random(11);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int n = 0; n < 20; ++n) {
    SetupResult report = oblique_report(Verdict::kAccepted);
    report.table.support_rad = rad_from_deg(uniform(-90, 90));
    report.setup_error.translation() = Eigen::Vector3d(uniform(-30, 30), uniform(-3, 3), uniform(-0.2, 0.2));
    report.setup_error.linear() = rotation_from_zxy({uniform(-0.1, 0.1), uniform(-0.02, 0.02), uniform(-0.002, 0.002)});
    const double wide = n % 2 == 0 ? 1.5 : 0.2;  // sigma: rounded to 1 or to 0.1
    report.uncertainty = uncertainty_of_independent_axes({wide, 0.04, 0.1},
                                                         {rad_from_deg(0.05), rad_from_deg(wide), rad_from_deg(0.01)});
    const auto json = nlohmann::json::parse(json_report(report));
    const std::string pdf = text_of_pdf(report, 1), html = html_of(report), text = text_of(report);
    const auto csv = csv_of(report);
    const ShownShift shown = shown_shift(report);

    const auto check = [&](const std::string& name, const std::string& column, double exact, double two_sigma) {
      const std::string value = rounded(exact, two_sigma);
      const std::string escaped = std::regex_replace(value, std::regex("[.+]"), "\\$&");
      EXPECT_EQ(found(pdf, "\n *" + name + " +([-+0-9.]+)"), value) << name;
      EXPECT_EQ(found(html, "<th>" + name + "</th><td class=\"value\">([-+0-9.]+)<"), value) << name;
      EXPECT_EQ(found(text, "\n  " + name + " +([-+0-9.]+)"), value) << name;
      EXPECT_EQ(csv.at(column), value.starts_with('+') ? value.substr(1) : value) << name;
    };
    const auto& couch = json["couch_shift"];
    const auto sigma = [&](std::size_t axis) { return 2.0 * shown.couch_sigma_mm[axis].value(); };
    check("Lateral", "lateral_mm", couch["lateral_mm"], sigma(0));
    check("Longitudinal", "longitudinal_mm", couch["longitudinal_mm"], sigma(1));
    check("Vertical", "vertical_mm", couch["vertical_mm"], sigma(2));
    check("Yaw", "yaw_deg", couch["yaw_deg"], 0.02);
    check("Pitch", "pitch_deg", couch["pitch_deg"], 0.1);
    check("Roll", "roll_deg", couch["roll_deg"], 2.0 * wide);
    const auto& error = json["setup_error"];
    check("x", "error_x_mm", error["translation_mm"][0], 2.0 * wide);
    check("y", "error_y_mm", error["translation_mm"][1], 0.08);
    check("about x", "error_about_x_deg", error["rotation_deg"]["rx"], 0.1);
    check("about y", "error_about_y_deg", error["rotation_deg"]["ry"], 2.0 * wide);
    EXPECT_EQ(csv.at("two_sigma_error_x_mm"), rounded_up(2.0 * wide));
    EXPECT_THAT(pdf, HasSubstr("± " + rounded_up(2.0 * wide) + " mm"));
  }
}

TEST(Report, RejectedResultsShowNoShiftInAnyFormat) {
  SetupResult report = oblique_report(Verdict::kRejected);
  report.site = small_couch();
  const auto json = nlohmann::json::parse(json_report(report));
  EXPECT_TRUE(json["couch_shift"].is_null());
  EXPECT_TRUE(json["couch_target_deg"].is_null());
  EXPECT_TRUE(json["left_over"].empty());
  EXPECT_EQ(json["action"], "unset");
  for (const std::string& shown : {text_of(report), text_of_pdf(report), html_of(report)}) {
    EXPECT_THAT(shown, HasSubstr("withheld"));
    for (const char* number : {"6.6", "-5.1", "5.2", "7.4", "+3.9", "13.0", "-2.9", "+3.0", "347.0"})
      EXPECT_THAT(shown, Not(HasSubstr(number)));
  }
  const auto csv = csv_of(report);
  for (const char* column :
       {"lateral_mm", "longitudinal_mm", "vertical_mm", "yaw_deg", "pitch_deg", "roll_deg", "error_x_mm"})
    EXPECT_EQ(csv.at(column), "") << column;
}

TEST(Report, UnobservableComponentsAreNull) {
  SetupResult report = oblique_report(Verdict::kReview);
  // Gantry 45: the view cannot tell along (sin 45, 0, cos 45); at couch 10 that enters all three table axes.
  report.unobservable_room = {Eigen::Vector3d(std::sqrt(0.5), 0, std::sqrt(0.5))};
  const auto json = nlohmann::json::parse(json_report(report));
  EXPECT_TRUE(json["setup_error"]["translation_mm"][0].is_null());
  EXPECT_NEAR(json["setup_error"]["translation_mm"][1], 3.9, 1e-12);
  EXPECT_TRUE(json["setup_error"]["translation_mm"][2].is_null());
  EXPECT_TRUE(json["couch_shift"]["lateral_mm"].is_null());
  EXPECT_TRUE(json["couch_shift"]["longitudinal_mm"].is_null());
  EXPECT_TRUE(json["couch_shift"]["vertical_mm"].is_null());
  EXPECT_THAT(text_of(report), HasSubstr("  Vertical       not determined\n"));
  EXPECT_EQ(found(text_of_pdf(report), "Vertical +(not determined)"), "not determined");
  EXPECT_EQ(csv_of(report).at("vertical_mm"), "");
}

TEST(Report, RoundsHalvesAwayFromZeroAndNeverToMinusZero) {
  EXPECT_EQ(rounded(0.25), "+0.3");
  EXPECT_EQ(rounded(-0.25), "-0.3");
  EXPECT_EQ(rounded(-0.04), "0.0");
  EXPECT_EQ(rounded(12.34), "+12.3");
}

TEST(Report, RoundsCoarselyWhereTheUncertaintyIsLarge) {
  EXPECT_EQ(rounded(4.46, 1.0), "+4.5");
  EXPECT_EQ(rounded(4.5, 1.01), "+5");
  EXPECT_EQ(rounded(-0.4, 3.0), "0");
  EXPECT_EQ(rounded_up(1.01), "2");
  EXPECT_EQ(rounded_up(0.11), "0.2");
  EXPECT_EQ(rounded_up(0.2), "0.2");
}

TEST(Report, CentimetersAreRoundedAsMillimetersAre) {
  EXPECT_EQ(rounded_length(4.25, LengthUnit::kMm), "+4.3");
  EXPECT_EQ(rounded_length(4.25, LengthUnit::kCm), "+0.43");
  EXPECT_EQ(rounded_length(-14.6, LengthUnit::kCm, 2.0), "-1.5");
  EXPECT_EQ(rounded_length(0.04, LengthUnit::kCm), "0.00");
  SetupResult report = oblique_report(Verdict::kAccepted);
  report.site = small_couch();
  report.site->length_unit = LengthUnit::kCm;
  EXPECT_THAT(text_of(report), HasSubstr("  Lateral         +0.66 cm   to the right"));
  EXPECT_EQ(csv_of(report).at("lateral_mm"), "6.6");
}

TEST(Report, ActionSaysWhatExceedsTheLevel) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  report.site = small_couch();
  EXPECT_EQ(shown_shift(report).decision.action, Action::kExceeds);
  EXPECT_THAT(shown_shift(report).decision.reasons, testing::ElementsAre("setup error along x, z: more than 5 mm"));
  report.site->level = ActionLevel{.translation_mm = 7.5, .vector_mm = 9.0};
  EXPECT_THAT(shown_shift(report).decision.reasons, testing::ElementsAre("length of the translation: more than 9 mm"));
  report.site->level->vector_mm = 10.0;
  EXPECT_EQ(shown_shift(report).decision.action, Action::kWithin);
  EXPECT_THAT(text_of(report), HasSubstr("ACTION       The shift is within the action level\n"));
  EXPECT_EQ(nlohmann::json::parse(json_report(report))["action"], "within");

  // What was not determined may be anything; what was may be enough.
  report.unobservable_room = {Eigen::Vector3d::UnitZ()};
  EXPECT_EQ(shown_shift(report).decision.action, Action::kUnset);
  report.site->level->vector_mm = 8.0;
  EXPECT_EQ(shown_shift(report).decision.action, Action::kExceeds);
  report.site->level->vector_mm = 10.0;
  report.site->level->translation_mm = 1.0;
  EXPECT_EQ(shown_shift(report).decision.action, Action::kExceeds);
}

TEST(Report, SmallCouchesSayWhatTheyApplyAndWhatRemains) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  report.site = small_couch();
  report.table_position_mm = Eigen::Vector3d(0.0, 1350.0, -135.0);
  report.points = {{"centroid of PTV", {10, 20, 30}}};
  const std::string text = text_of(report);
  EXPECT_THAT(text, HasSubstr("  Yaw              +3.0 deg"));
  EXPECT_THAT(text, HasSubstr("  Pitch          not applied: this couch has 4 degrees of freedom\n"));
  EXPECT_THAT(text, HasSubstr("IEC table angles after the move: yaw +13.0, pitch 0.0, roll 0.0 deg"));
  // Vertical counts down on this display: 135.0 mm below the isocenter is 135.0, 5.2 mm higher 129.8.
  EXPECT_THAT(text, HasSubstr("Varian IEC scale, validated by J. Doe on 2026-03-01"));
  EXPECT_THAT(text, HasSubstr("  Vertical         -5.2 mm   from 135.0 to 129.8 mm\n"));
  EXPECT_THAT(text, HasSubstr("from 350.0 to 347.0 deg"));
  for (const auto& left : shown_shift(report).left_over) {
    const CouchShift applied =
        applicable_shift(report.setup_error, report.table, CouchDof::kFour, Eigen::Vector3d::Zero());
    if (left.at != "centroid of PTV") continue;
    EXPECT_LT((left.mm - left_over_mm(report.setup_error, report.table, applied, {10, 20, 30})).norm(), 1e-12);
    EXPECT_GT(left.mm.norm(), 0.1);
  }
  EXPECT_EQ(shown_shift(report).left_over.size(), 4U);
  report.site->couch_dof = CouchDof::kSix;
  EXPECT_TRUE(report_page(report).left_over.empty());
}

TEST(Report, TheLegendNamesOnlyWhatThePicturesShow) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  ASSERT_FALSE(report.views.empty());
  for (SetupResult::View& view : report.views) view.match.consistency.parts.clear();
  EXPECT_THAT(report_page(report).picture_words, testing::Not(HasSubstr("Yellow")));
  report.views[0].match.consistency.parts = {{.center_px = {3, 3}, .has_signal = true, .disagrees = true}};
  EXPECT_THAT(report_page(report).picture_words, HasSubstr("Yellow squares"));
  report.views[0].picture.moved = {{{1, 1}, {2, 2}}};
  const std::string words = report_page(report).picture_words;
  EXPECT_THAT(words, HasSubstr("Yellow arrows: bones that lie off once the target is right, 5 times as long"));
  EXPECT_THAT(words, testing::Not(HasSubstr("squares")));
  EXPECT_THAT(html_of(report), HasSubstr(words));
}

TEST(Report, TheTargetStandsBehindThePatientAndIsBroughtRight) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  EXPECT_THAT(text_of(report), testing::Not(HasSubstr("Target ")));
  report.target = Target{.name = "PTV 60", .chosen_by = "dose reference of the plan", .center_room_mm = {10, 80, -20}};
  report.uncertainty = uncertainty_of_independent_axes({0.1, 0.1, 0.1}, Eigen::Vector3d::Constant(0.001));
  const ReportPage page = report_page(report);
  EXPECT_EQ(page.who[0].name, "Patient");
  EXPECT_EQ(page.who[1].name, "Target");
  EXPECT_EQ(page.who[1].value, "PTV 60 (dose reference of the plan)");
  const Eigen::Vector3d center = report.target->center_room_mm;
  const ShownShift shown = shown_shift(report);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto n = static_cast<Eigen::Index>(axis);
    EXPECT_NEAR(*shown.target_mm[axis], (report.setup_error * center - center)[n], 1e-9);
    // By hand: 0.1 mm and 0.001 rad about the two other axes, at their distances from where it was found.
    const Eigen::Vector3d found = report.setup_error * center;
    EXPECT_NEAR(*shown.target_sigma_mm[axis],
                std::hypot(0.1, 0.001 * std::hypot(found[(n + 1) % 3], found[(n + 2) % 3])), 1e-9);
    EXPECT_EQ(shown.applied_mm[axis], shown.couch_mm[axis]);  // a couch that can do all
  }
  report.site = small_couch();
  const ShownShift small = shown_shift(report);
  EXPECT_GT(std::abs(*small.applied_mm[2] - *small.couch_mm[2]), 0.5);
  for (const auto& left : small.left_over) {
    if (left.at != "PTV 60") continue;
    EXPECT_LT(left.mm.norm(), 1e-9);
  }
  EXPECT_EQ(small.left_over.size(), 4U);
  const auto json = nlohmann::json::parse(json_report(report));
  EXPECT_EQ(json["target"]["name"], "PTV 60");
  EXPECT_EQ(json["couch_applied"]["brings_right"], "PTV 60");
  EXPECT_EQ(json["couch_applied"]["pitch_deg"], 0.0);
  EXPECT_NEAR(json["couch_applied"]["vertical_mm"], *small.applied_mm[2], 1e-9);
  const SetupResult read = report_from_json(json.dump(), "test");
  ASSERT_TRUE(read.target);
  EXPECT_EQ(read.target->chosen_by, "dose reference of the plan");
  EXPECT_EQ(read.target->center_room_mm, center);
}

// dicom.md 5.1: 50 mm superior with a couch of 4 degrees of freedom; feet first the patient points the other way.
TEST(Report, WhatRemainsIsThatOfDicomMd51) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  report.table = {};
  report.site = small_couch();
  report.setup_error.translation() = Eigen::Vector3d(3, -2, 1.5);
  report.setup_error.linear() = rotation_from_zxy({rad_from_deg(1), rad_from_deg(-0.5), rad_from_deg(0.8)});
  const Eigen::Vector3d toward_gantry(-0.006, -0.002, -0.436);
  for (const auto& [position, sign] : {std::pair("HFS", 1.0), std::pair("FFS", -1.0)}) {
    report.patient_position = position;
    const auto left_over = shown_shift(report).left_over;
    EXPECT_EQ(left_over[1].at, "50 mm superior");
    EXPECT_LT((left_over[1].mm - sign * toward_gantry).norm(), 1e-3) << position;
    EXPECT_LT((left_over[2].mm + sign * toward_gantry).norm(), 1e-3) << position;
  }
}

// The table top's axes turn with the couch: at 90 degrees its lateral axis points toward the gantry.
TEST(Report, WordsAreThoseOfTheRoomWhereverTheCouchStands) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  report.setup_error = Eigen::Isometry3d::Identity();
  report.setup_error.translation() = Eigen::Vector3d(5, -3, 0);  // to the right, away from the gantry
  const auto words = [&](double couch_deg) {
    report.table.support_rad = rad_from_deg(couch_deg);
    const ReportPage page = report_page(report);
    return std::pair(page.couch[0].words, page.couch[1].words);
  };
  EXPECT_EQ(words(0), std::pair(std::string("to the left, seen facing the gantry"), std::string("toward the gantry")));
  EXPECT_EQ(words(90), std::pair(std::string("toward the gantry"), std::string("to the left, seen facing the gantry")));
  EXPECT_EQ(words(270),
            std::pair(std::string("toward the gantry"), std::string("to the left, seen facing the gantry")));
  EXPECT_EQ(words(45).second, "toward the gantry and to the left, seen facing the gantry");
  EXPECT_EQ(words(180),
            std::pair(std::string("to the left, seen facing the gantry"), std::string("toward the gantry")));
}

// What was not measured is in no number, however little of it an axis holds.
TEST(Report, NothingIsMadeOfWhatWasNotMeasured) {
  SetupResult report = oblique_report(Verdict::kReview);
  report.table.support_rad = rad_from_deg(2.0);
  report.unobservable_room = {Eigen::Vector3d::UnitX()};
  const auto longitudinal = [&](double x_mm) {
    report.setup_error.translation().x() = x_mm;
    return shown_shift(report).couch_mm[1].value();
  };
  EXPECT_NEAR(longitudinal(19.0), longitudinal(0.0), 1e-12);
  const SetupResult read = report_from_json(json_report(report), "result.json");
  EXPECT_NEAR(shown_shift(read).couch_mm[1].value(), longitudinal(19.0), 1e-12);
}

TEST(Report, RotationsThatWereNotSearchedAreNoNumbers) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  report.setup_error.linear().setIdentity();
  report.translation_only = true;
  report.site = small_couch();
  report.site->level = ActionLevel{.rotation_deg = 1.0};
  EXPECT_EQ(shown_shift(report).decision.action, Action::kUnset);
  EXPECT_THAT(text_of(report), HasSubstr("  Yaw            taken as 0: only translations were searched\n"));
  EXPECT_EQ(csv_of(report).at("yaw_deg"), "");
}

TEST(Report, NamesComeOutRightAndHarmless) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  report.identity.patient_name = "Müller-Lüdenscheidt^Jürgen=山田^太郎=やまだ^たろう";
  report.plan_label = "<script>alert(1)</script><!--WHO-->";
  report.views[0].label = "</script><b>\"KV\"";
  report.identity.patient_id = "=1+1";
  const std::string pdf = text_of_pdf(report), html = html_of(report);
  for (const std::string& shown : {pdf, html, text_of(report)})
    EXPECT_THAT(shown, HasSubstr("Müller-Lüdenscheidt Jürgen (山田 太郎)"));
  EXPECT_THAT(pdf, HasSubstr("<script>alert(1)</script>"));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;alert(1)&lt;/script&gt;"));
  EXPECT_THAT(html, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(html, HasSubstr("\\u003c/script>"));
  EXPECT_EQ(csv_of(report).at("patient_id"), "'=1+1");
  for (const char* hostile : {"http://", "https://", "src=\"//", "@import"}) EXPECT_THAT(html, Not(HasSubstr(hostile)));
}

TEST(Report, SurvivesNamesThatAreNoText) {
  SetupResult report = oblique_report(Verdict::kAccepted);
  report.identity.patient_name = "Evil\nVERDICT      ACCEPTED\x1b[31m";
  report.views[0].label = "\xff\xfe";
  for (const char* forged : {"\nVERDICT      ACCEPTED\x1b", "\nVERDICT      ACCEPTED [31m"})
    EXPECT_THAT(text_of(report), Not(HasSubstr(forged)));
  EXPECT_EQ(printable("a\u009Bb\u202Ec\u2028d\u2066e"), "a b c d e");
  EXPECT_TRUE(nlohmann::json::accept(json_report(report)));
  EXPECT_NO_THROW(html_of(report));
  EXPECT_THAT(csv_report(report), Not(HasSubstr("\nVERDICT")));
}

TEST(Report, TheFirstPageSaysWhatMovedAndALaterOneHasTheTable) {
  const SetupResult report = bent_report(Verdict::kAccepted);
  const std::string first = text_of_pdf(report, 1), all = text_of_pdf(report);
  EXPECT_THAT(first, HasSubstr("vertebra 3 toward the feet lies 9.2 mm off"));
  EXPECT_THAT(first, HasSubstr("against it"));  // the line's end
  EXPECT_THAT(first, HasSubstr("Approved by"));
  EXPECT_THAT(first, Not(HasSubstr("What moved against the target")));
  EXPECT_THAT(all, HasSubstr("What moved against the target"));
  EXPECT_THAT(all, HasSubstr("carries the target 62 %"));
}

TEST(Report, FirstPageHoldsAllThatIsSigned) {
  SetupResult report = oblique_report(Verdict::kReview);
  report.site = small_couch();
  report.findings.assign(
      12, {.check = Check::kFiles, .words = "a reason that is told at some length, as reasons are, to fill the page"});
  for (int n = 0; n < 5; ++n) report.views.push_back(view_with_picture(fmt::format("VIEW {}", n)));
  report.warnings = std::vector<std::string>(80, "a warning");
  const std::string first = text_of_pdf(report, 1), all = text_of_pdf(report);
  for (const char* words : {"Example", "REVIEW", "MOVE THE COUCH BY", "Approved by", "Decision", "IEC 61217:",
                            "Not for clinical use unless validated by the site.", "and 8 more, on the next page"})
    EXPECT_THAT(first, HasSubstr(words));
  for (int n = 0; n < 5; ++n) EXPECT_THAT(all, HasSubstr(fmt::format("VIEW {}", n)));
  for (const char* words : {"Geometry as understood", "Provenance", "SHA-256"}) EXPECT_THAT(all, HasSubstr(words));
  std::size_t pages = 0, disclaimers = 0;
  for (const char c : all) pages += c == '\f';
  for (std::size_t at = all.find("Not for clinical"); at != std::string::npos;
       at = all.find("Not for clinical", at + 1))
    ++disclaimers;
  EXPECT_EQ(disclaimers, pages + 1);  // on every page, on the first one twice
}

// Breaking one long word took a minute.
TEST(Canvas, TextsThatNobodyWritesAreShortened) {
  Canvas canvas(Canvas::Kind::kPng, 200.0, 200.0);
  const TextStyle style{.width = 150.0};
  EXPECT_EQ(canvas.text_height(std::string(200'000, 'x'), style), canvas.text_height(std::string(3000, 'x'), style));
}

}  // namespace
}  // namespace isoshift::report_test
