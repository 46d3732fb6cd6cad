// The table of used shifts, registration objects in its place, and the archive that they are compared with.

#include "workflow/audit_setup/used_shifts.h"
#include "tests/support/findings.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.h"
#include "base/output_folder.h"
#include "io/report/formats.h"
#include "io/report/result_folder.h"
#include "tests/support/oblique_report.h"
#include "tests/support/temporary_folder.h"
#include "workflow/audit_setup/archive.h"

namespace isoshift::used_shifts_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class AuditArchive : public testing::Test {
 protected:
  // The worked example of docs/conventions.md, with X-rays and times of its own.
  static SetupResult example(const std::string& xray, const std::string& acquired) {
    SetupResult result = oblique_report(Verdict::kAccepted);
    result.views.front().sop_instance_uid = xray;
    result.views.front().acquired = acquired;
    return result;
  }
  void write(const std::string& folder, const SetupResult& result) {
    fs::create_directories(archive() / folder);
    write_text(archive() / folder / kResultFile, json_report(result));
  }
  fs::path archive() const { return folder_ / "archive"; }
  std::vector<AuditedSession> read(ComparedShift compared = ComparedShift::kFull) const {
    return read_archive(archive(), compared);
  }
  // The message about a table with this text, for a session "a".
  std::string error_of(const std::string& text) {
    replace_text(folder_ / "used.csv", text);
    std::vector<AuditedSession> sessions = {{.name = "a"}};
    try {
      read_used_table(folder_ / "used.csv", sessions);
    } catch (const Error& error) {
      return std::string(error.what()).substr((folder_ / "used.csv").string().size());
    }
    return "";
  }

  TemporaryFolder folder_;
};

constexpr const char* kHeader = "session,lateral_mm,longitudinal_mm,vertical_mm,yaw_deg,pitch_deg,roll_deg\n";

TEST_F(AuditArchive, IsReadInTheOrderOfTimeWithTheShiftsOfTheReports) {
  write("cases/later", example("1.2", "2026-03-02 10:00:00"));
  write("sessions/first", example("1.1", "2026-03-01 10:00:00"));
  write("superseded/old", example("1.1", "2026-03-01 10:00:00"));
  write(".half-written", example("1.3", "2026-03-01 10:00:00"));
  const std::vector<AuditedSession> sessions = read();
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_EQ(sessions[0].name, "first");
  EXPECT_EQ(sessions[1].name, "later");
  EXPECT_DOUBLE_EQ(sessions[1].day - sessions[0].day, 1.0);
  const double expected[] = {6.610, -5.126, 5.200, 2.969, 1.861, -2.172};
  for (std::size_t axis = 0; axis < 6; ++axis) EXPECT_NEAR(*sessions[0].found[axis], expected[axis], 1e-3) << axis;
}

TEST_F(AuditArchive, NamesFoldersOfOneNameWithThoseAboveThem) {
  write("p1/f1", example("1.1", "2026-03-01 10:00:00"));
  write("p2/f1", example("1.2", "2026-03-01 11:00:00"));
  write("p2/f2", example("1.3", "2026-03-02 11:00:00"));
  std::vector<std::string> names;
  for (const AuditedSession& session : read()) names.push_back(session.name);
  EXPECT_THAT(names, ElementsAre("p1/f1", "p2/f1", "f2"));
}

// What follows a session that does not count may show what its couch shift has left.
TEST_F(AuditArchive, TheFirstOfADayIsTheFirstThatWasImaged) {
  SetupResult review = example("1.1", "2026-03-01 09:00:00");
  review.findings = findings_for(Verdict::kReview, "the target's surroundings match poorly");
  write("reviewed", review);
  write("after", example("1.2", "2026-03-01 09:06:00"));
  write("next-day", example("1.3", "2026-03-02 09:00:00"));
  std::map<std::string, bool> is_first;
  for (const AuditedSession& session : read()) is_first[session.name] = session.is_first_of_day;
  EXPECT_FALSE(is_first["after"]);
  EXPECT_TRUE(is_first["next-day"]);
}

TEST_F(AuditArchive, CountsTheLastResultOfTheSameXraysAndWhatWasAccepted) {
  SetupResult first = example("1.1", "2026-03-01 10:00:00"), again = first;
  first.made_on = "2026-03-01T10:05:00+0100";
  again.made_on = "2026-03-01T11:05:00+0100";
  write("a", first);
  write("a-2", again);
  SetupResult review = example("1.2", "2026-03-02 10:00:00");
  review.findings = findings_for(Verdict::kReview, "the target's surroundings match poorly");
  write("b", review);
  write("c", example("1.3", ""));
  fs::create_directories(archive() / "d");
  write_text(archive() / "d" / kResultFile, "{}");
  std::map<std::string, std::string> left_out;
  for (const AuditedSession& session : read()) left_out[session.name] = session.left_out;
  EXPECT_EQ(left_out["a"], "its X-ray has a later result: a-2");
  EXPECT_EQ(left_out["a-2"], "");
  EXPECT_EQ(left_out["b"], "isoshift did not accept it (review)");
  EXPECT_EQ(left_out["c"], "the time of its X-rays is not known");
  EXPECT_THAT(left_out["d"], HasSubstr("result.json"));
}

TEST_F(AuditArchive, ComparesATableWithWhatTheSitesCouchCanDo) {
  SetupResult result = example("1.1", "2026-03-01 10:00:00");
  result.site = small_couch();  // without pitch and roll
  write("a", result);
  const CouchAxes of_couch = read(ComparedShift::kOfSitesCouch).front().found;
  EXPECT_TRUE(of_couch[3]);
  EXPECT_FALSE(of_couch[4] || of_couch[5]);
  EXPECT_TRUE(read(ComparedShift::kFull).front().found[4]);
}

TEST_F(AuditArchive, WithoutResultsIsAnError) {
  fs::create_directories(archive() / "empty");
  EXPECT_THROW(read(), Error);
}

TEST_F(AuditArchive, ATableFillsInWhatItKnows) {
  write_text(folder_ / "used.csv", std::string("\xEF\xBB\xBF") + kHeader + "a,1.5,-2,+3.25,,,0\n\n");
  std::vector<AuditedSession> sessions = {{.name = "a"}, {.name = "b"}};
  read_used_table(folder_ / "used.csv", sessions);
  EXPECT_THAT(sessions[0].used, ElementsAre(1.5, -2.0, 3.25, std::nullopt, std::nullopt, 0.0));
  EXPECT_THAT(sessions[0].used_from, HasSubstr("line 2"));
  EXPECT_FALSE(sessions[1].used[0]);
}

// What isoshift found in five sessions, and a table that says the same to 0.1 mm and degrees.
class UsedTable : public AuditArchive {
 protected:
  UsedTable() {
    const double found[5][6] = {{3.1, -5.2, 1.4, 1.2, -0.8, 0.4},
                                {-2.4, 4.4, 6.1, -1.9, 0.6, 1.1},
                                {5.6, 1.2, -3.3, 0.5, 1.6, -1.3},
                                {-0.7, -2.8, 4.9, 2.2, -1.5, 0.9},
                                {1.9, 7.3, -2.2, -0.9, 0.3, -2.0}};
    for (std::size_t n = 0; n < 5; ++n) {
      AuditedSession& session = sessions_.emplace_back();
      session.name = std::string(1, static_cast<char>('a' + n));
      for (std::size_t axis = 0; axis < 6; ++axis) session.found[axis] = found[n][axis];
    }
  }
  // A table of the shifts, with columns as `header` names them, of which column n says `factor[n]` times axis[n].
  std::string error_of_table(const std::string& header, const std::array<double, 6>& factor,
                             const std::array<std::size_t, 6>& axis = {0, 1, 2, 3, 4, 5}) {
    std::string text = header + "\n";
    for (const AuditedSession& session : sessions_) {
      text += session.name;
      for (std::size_t n = 0; n < 6; ++n)
        text += fmt::format(",{:.3f}", factor[n] * (*session.found[axis[n]] + (n % 2 == 0 ? 0.1 : -0.1)));
      text += "\n";
    }
    replace_text(folder_ / "used.csv", text);
    read_ = sessions_;
    try {
      read_used_table(folder_ / "used.csv", read_);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::vector<AuditedSession> sessions_, read_;
};

TEST_F(UsedTable, OtherUnitsThanTheHeaderSaysAreFound) {
  const std::string header = used_shifts_header();
  EXPECT_EQ(error_of_table(header, {1, 1, 1, 1, 1, 1}), "");
  EXPECT_EQ(error_of_table(header, {1, -1, -1, 1, 1, -1}), "") << "signs are another matter";
  const std::string in_cm = error_of_table(header, {0.1, 0.1, 0.1, 1, 1, 1});
  for (const char* name : {"lateral", "longitudinal", "vertical"})
    EXPECT_THAT(in_cm, HasSubstr(fmt::format("10 times {0}_mm", name)));
  EXPECT_THAT(in_cm, AllOf(HasSubstr("name the column lateral_cm"), Not(HasSubstr("yaw"))));
  EXPECT_THAT(error_of_table(header, {1, 1, -0.1, 1, 1, 1}), HasSubstr("10 times vertical_mm"));
  constexpr double kRad = 0.0174533;
  EXPECT_THAT(error_of_table(header, {1, 1, 1, kRad, kRad, kRad}),
              AllOf(HasSubstr("57.3 times yaw_deg"), HasSubstr("name the column yaw_rad")));
  EXPECT_THAT(error_of_table(header, {10, 10, 10, 1, 1, 1}), HasSubstr("0.1 times lateral_mm"));
  const std::string stated = "session,lateral_cm,longitudinal_cm,vertical_cm,yaw_rad,pitch_rad,roll_rad";
  EXPECT_EQ(error_of_table(stated, {0.1, 0.1, 0.1, kRad, kRad, kRad}), "") << "as it says";
  EXPECT_NEAR(*read_[0].used[1], -5.3, 1e-3);
  EXPECT_NEAR(*read_[0].used[3], 1.1, 0.05);
  EXPECT_THAT(error_of_table(stated, {1, 1, 1, 1, 1, 1}),
              AllOf(HasSubstr("name the column lateral_mm"), HasSubstr("name the column roll_deg")));
}

TEST_F(UsedTable, ExchangedColumnsAreFoundAndMayBeNamedInTheirOrder) {
  const std::string exchanged = error_of_table(used_shifts_header(), {1, 1, 1, 1, 1, 1}, {0, 2, 1, 3, 4, 5});
  EXPECT_THAT(exchanged, AllOf(HasSubstr("longitudinal_mm fits to what was found as vertical_mm"),
                               HasSubstr("name the column longitudinal_mm"), Not(HasSubstr("lateral_mm fits"))));
  EXPECT_EQ(error_of_table("session,lateral_mm,vertical_mm,longitudinal_mm,yaw_deg,pitch_deg,roll_deg",
                           {1, 1, 1, 1, 1, 1}, {0, 2, 1, 3, 4, 5}),
            "");
  EXPECT_THAT(error_of_table(used_shifts_header(), {0.1, 0.1, 0.1, 1, 1, 1}, {0, 2, 1, 3, 4, 5}),
              HasSubstr("10 times longitudinal_mm fits to what was found as vertical_mm"));
}

TEST_F(UsedTable, WhatWasNotAppliedIsInNoOtherUnit) {
  EXPECT_EQ(error_of_table(used_shifts_header(), {0, 0, 0, 0, 0, 0}), "");
  EXPECT_EQ(error_of_table(used_shifts_header(), {1, 0, 1, 1, 0, 0}), "");
  EXPECT_EQ(error_of_table(used_shifts_header(), {0.5, 0.5, 2, 1, 1, 1}), "");
}

TEST_F(UsedTable, LengthsInInchesAndMetersAreFound) {
  EXPECT_THAT(error_of_table(used_shifts_header(), {1 / 25.4, 1 / 25.4, 1 / 25.4, 1, 1, 1}),
              HasSubstr("25.4 times lateral_mm"));
  EXPECT_THAT(error_of_table(used_shifts_header(), {0.001, 0.001, 0.001, 1, 1, 1}),
              HasSubstr("1e+03 times lateral_mm"));
}

TEST_F(UsedTable, LengthsAndAnglesThatAreExchangedAreFound) {
  EXPECT_THAT(error_of_table(used_shifts_header(), {1, 1, 1, 1, 1, 1}, {3, 4, 5, 0, 1, 2}),
              AllOf(HasSubstr("lateral_mm fits to what was found as yaw_deg"),
                    HasSubstr("roll_deg fits to what was found as vertical_mm")));
  EXPECT_THAT(error_of_table(used_shifts_header(), {1, 1, 1, 1, 1, 1}, {3, 1, 2, 0, 4, 5}),
              HasSubstr("yaw_deg fits to what was found as lateral_mm"));
}

// As after a console was exchanged.
TEST_F(UsedTable, SomeSessionsInAnotherUnitAreFound) {
  std::string text = used_shifts_header() + "\n";
  for (std::size_t n = 0; n < sessions_.size(); ++n) {
    const double factor = n < 2 ? 0.1 : 1.0;
    const CouchAxes& found = sessions_[n].found;
    text += fmt::format("{},{:.2f},{:.2f},{:.2f},{:.2f},,\n", sessions_[n].name, factor * *found[0], factor * *found[1],
                        factor * *found[2], *found[3]);
  }
  replace_text(folder_ / "used.csv", text);
  std::string error;
  try {
    read_used_table(folder_ / "used.csv", sessions_);
  } catch (const Error& thrown) {
    error = thrown.what();
  }
  EXPECT_THAT(error, HasSubstr("10 times the lengths of 2 of 5 sessions: a, b"));
}

// What is small by itself is near to nearly nothing, in whatever unit.
TEST_F(UsedTable, ShiftsThatTellNothingOfSmallSetupErrorsAreInNoOtherUnit) {
  const double small[5] = {0.3, -0.2, 0.4, 0.1, -0.3};
  for (std::size_t n = 0; n < 5; ++n)
    for (std::size_t axis = 0; axis < 3; ++axis) sessions_[n].found[axis] = small[(n + axis) % 5];
  std::string text = used_shifts_header() + "\n";
  const double used[5] = {-4.0, 3.1, 2.2, -5.0, 3.3};
  for (std::size_t n = 0; n < 5; ++n)
    text += fmt::format("{},{},{},{},,,\n", sessions_[n].name, used[n], used[4 - n], used[n]);
  replace_text(folder_ / "used.csv", text);
  EXPECT_NO_THROW(read_used_table(folder_ / "used.csv", sessions_));
}

TEST_F(UsedTable, ATurnIsTheSameAroundTheCircle) {
  replace_text(folder_ / "used.csv", "session,yaw_deg\na,359.2\nb,1.9\n");
  read_used_table(folder_ / "used.csv", sessions_);
  EXPECT_NEAR(sessions_[0].used[3].value(), -0.8, 1e-9);
  EXPECT_DOUBLE_EQ(sessions_[1].used[3].value(), 1.9);
  EXPECT_FALSE(sessions_[0].used[0]) << "a column that is not there is not known";
}

// As a spreadsheet set to German writes it.
TEST_F(UsedTable, SemicolonsAndDecimalCommasAreNamed) {
  EXPECT_THAT(error_of("session;lateral_mm;longitudinal_mm\na;1,5;2\n"),
              AllOf(HasSubstr(", line 1: semicolons separate the cells"), HasSubstr("decimal point")));
}

TEST_F(AuditArchive, MistakesInATableAreNamedWithLineAndColumn) {
  const std::string header = kHeader;
  EXPECT_THAT(error_of("session,x\n"),
              HasSubstr(", line 1: the columns are \"session,x\", expected session,lateral_mm"));
  EXPECT_THAT(error_of(header + "b,1,2,3,,,\n"), HasSubstr(", line 2, column session: there is no session \"b\""));
  EXPECT_THAT(error_of(header + "a,1,2,3,,,\na,1,2,3,,,\n"),
              HasSubstr(", line 3, column session: \"a\" is there twice"));
  EXPECT_THAT(error_of(header + "a,1,2 cm,3,,,\n"),
              HasSubstr(", line 2, column longitudinal_mm: \"2 cm\" is not a finite"));
  EXPECT_THAT(error_of(header + "a,1,2,nan,,,\n"), HasSubstr(", line 2, column vertical_mm: \"nan\" is not a finite"));
  EXPECT_THAT(error_of(header + "a,1,2,3,1e999,,\n"), HasSubstr(", line 2, column yaw_deg: \"1e999\" is not a finite"));
  EXPECT_THAT(error_of(header + "a,1,2,3\n"), HasSubstr(", line 2: 4 cells, expected 7"));
  EXPECT_THAT(error_of(header + "a,\"1,2,3,,,\n"), HasSubstr(", line 2: "));
  EXPECT_THAT(error_of(""), HasSubstr(", line 1: the columns are"));
  EXPECT_THAT(error_of(header), HasSubstr(": names no session"));
  EXPECT_THAT(error_of(header + "a,1,2e6,3,,,\n"),
              HasSubstr(", line 2, column longitudinal_mm: 2e+06 is no couch shift"));
}

}  // namespace
}  // namespace isoshift::used_shifts_test
