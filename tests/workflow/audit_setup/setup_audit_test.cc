#include "workflow/audit_setup/setup_audit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/audited_archive.h"
#include "workflow/audit_setup/audit_words.h"

namespace isoshift::setup_audit_test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

std::vector<std::size_t> drifting_axes(const SetupAudit& audit) {
  std::vector<std::size_t> axes;
  for (std::size_t axis = 0; axis < audit.axes.size(); ++axis)
    if (audit.axes[axis].drift && audit.axes[axis].drift->is_significant()) axes.push_back(axis);
  return axes;
}

const SetupAudit::Outlier* outlier_named(const SetupAudit& audit, std::size_t session) {
  for (const SetupAudit::Outlier& outlier : audit.outliers)
    if (audit.sessions[outlier.session].name == MadeArchive::name_of(session)) return &outlier;
  return nullptr;
}

std::string explanation(const SetupAudit& audit, std::size_t session) {
  const SetupAudit::Outlier* outlier = outlier_named(audit, session);
  return outlier == nullptr ? "" : outlier->explanation;
}

TEST(SetupAudit, AWholeTurnIsNoDifference) {
  AuditedSession session;
  session.found[3] = -2.03;
  session.used[3] = 357.97;
  EXPECT_NEAR(session.difference()[3].value(), 0.0, 1e-9);
}

// Twenty audits of a year without a mistake call one; so of 200 about ten, and more than 20 once in a thousand times.
TEST(SetupAudit, RarelyCallsAnythingWhereNothingIsWrong) {
  int with_outliers = 0, with_drift = 0, with_setup_drift = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const SetupAudit audit = audit_of(audited(made_archive(seed, 0.0, false)));
    with_outliers += audit.outliers.empty() ? 0 : 1;
    with_drift += drifting_axes(audit).empty() ? 0 : 1;
    for (const auto& drift : audit.setup_drift)
      if (drift && drift->is_significant()) {
        ++with_setup_drift;
        break;
      }
  }
  RecordProperty("with_outliers", with_outliers);
  RecordProperty("with_drift", with_drift);
  RecordProperty("with_setup_drift", with_setup_drift);
  EXPECT_LE(with_outliers, 20);
  EXPECT_LE(with_drift, 20);
  EXPECT_LE(with_setup_drift, 20);
}

TEST(SetupAudit, FindsDriftSwapAndWrongSignsAndRarelyMore) {
  int missed = 0, unexplained = 0, more = 0, drift_missed = 0, other_drift = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const MadeArchive archive = made_archive(seed, 2.5, true);
    const SetupAudit audit = audit_of(audited(archive));
    int planted = 0;
    const auto check = [&](std::size_t session, const std::string& words) {
      const std::string found = explanation(audit, session);
      missed += found.empty() ? 1 : 0;
      planted += found.empty() ? 0 : 1;
      unexplained += !found.empty() && found.find(words) == std::string::npos ? 1 : 0;
    };
    check(archive.swapped, "swapped patient: the used shift is that of session " +
                               MadeArchive::name_of(archive.swapped ^ 1) + ", of another patient");
    for (const std::size_t n : {0U, 1U})
      check(archive.signs[n], std::string("wrong sign of ") + kCouchAxes[archive.sign_axes[n]]);
    more += static_cast<int>(audit.outliers.size()) - planted > 0 ? 1 : 0;
    const std::vector<std::size_t> axes = drifting_axes(audit);
    drift_missed += std::ranges::find(axes, 1U) == axes.end() ? 1 : 0;
    other_drift += static_cast<int>(axes.size()) - (std::ranges::find(axes, 1U) == axes.end() ? 0 : 1) > 0 ? 1 : 0;
  }
  RecordProperty("missed_of_600", missed);
  RecordProperty("unexplained", unexplained);
  RecordProperty("audits_with_more", more);
  RecordProperty("drift_missed", drift_missed);
  RecordProperty("other_drift", other_drift);
  EXPECT_EQ(missed, 0);
  EXPECT_LE(unexplained, 6);
  EXPECT_LE(more, 20);
  EXPECT_LE(drift_missed, 2);
  EXPECT_LE(other_drift, 20);
}

TEST(SetupAudit, ADriftIsNoOutlierAndAnOutlierNoDrift) {
  // 10 mm in a year: differences that are usual in December would be far off in January.
  const SetupAudit drifting = audit_of(audited(made_archive(3, 10.0, false)));
  EXPECT_TRUE(drifting.outliers.empty());
  EXPECT_THAT(drifting_axes(drifting), testing::ElementsAre(1U));
  EXPECT_NEAR(drifting.axes[1].drift->slope, 10.0 * 30.0 / 365.0, 0.15);
  // The last five sessions are 20 mm off.
  std::vector<AuditedSession> sessions = audited(made_archive(3, 0.0, false));
  for (std::size_t n = 55; n < 60; ++n) *sessions[n].used[0] += n % 2 == 0 ? 20.0 : -20.0;
  const SetupAudit with_outliers = audit_of(std::move(sessions));
  EXPECT_EQ(with_outliers.outliers.size(), 5U);
  EXPECT_TRUE(drifting_axes(with_outliers).empty());
}

TEST(SetupAudit, ExplainsWhatOneMistakeExplains) {
  std::vector<AuditedSession> sessions = audited(made_archive(5, 0.0, false));
  sessions[10].found = sessions[10].used = {4.0, -7.0, 2.0, 0.5, 2.5, -1.5};
  sessions[11].found = sessions[11].used = {-5.0, -5.0, 5.0, 0.0, 0.0, 0.0};  // the other one of that day
  const auto explained = [&](const CouchAxes& used) {
    sessions[10].used = used;
    return explanation(audit_of(sessions), 10);
  };
  EXPECT_EQ(explained({4.0, -7.0, 2.0, 0.5, 2.5, -1.5}), "");
  EXPECT_EQ(explained({4.1, 6.8, 2.1, 0.4, 2.5, -1.6}), "wrong sign of longitudinal");
  EXPECT_EQ(explained({-7.0, 4.0, 2.0, 0.5, 2.5, -1.5}), "lateral and longitudinal are exchanged");
  EXPECT_EQ(explained({0.0, 0.0, 0.0, 0.0, 0.0, 0.0}), "the shift was not applied");
  EXPECT_EQ(explained({-4.0, 7.0, -2.0, -0.5, -2.5, 1.5}), "all signs are wrong: the shift was applied backwards");
  EXPECT_EQ(explained({-4.9, -5.1, 5.0, 0.1, -0.1, 0.0}),
            "swapped patient: the used shift is that of session f12, of another patient and the same day");
  EXPECT_EQ(explained({4.0, 0.0, 2.0, 0.5, 2.5, -1.5}), "longitudinal was not applied");
  EXPECT_EQ(explained({9.0, 9.0, 9.0, 0.5, 2.5, -1.5}), "no single mistake explains it");
  // Only what is known is compared: without rotations, too.
  EXPECT_EQ(explained({4.1, 6.8, 2.1, std::nullopt, std::nullopt, std::nullopt}), "wrong sign of longitudinal");
}

TEST(SetupAudit, CountsWhatIsoshiftAcceptedAndSaysWhatItDidNot) {
  std::vector<AuditedSession> sessions = audited(made_archive(6, 0.0, false));
  const SetupAudit before = audit_of(sessions);
  sessions[7].left_out = "isoshift did not accept it (rejected)";
  sessions[7].used[0] = 500.0;
  const SetupAudit audit = audit_of(sessions);
  EXPECT_EQ(audit.counted, 59U);
  EXPECT_EQ(audit.compared, 59U);
  EXPECT_TRUE(audit.outliers.empty());
  EXPECT_EQ(audit.axes[0].of_all->count, 59U);
  EXPECT_EQ(before.axes[0].of_all->count, 60U);
}

// Two patients with two fractions each, worked by hand: x is 1 and 3, and -2 and 0; the clinic leaves 1 and 1, 0 and 2.
TEST(SetupAudit, GivesMarginsOfWhatWasFoundAndOfWhatIsLeft) {
  std::vector<AuditedSession> sessions;
  const auto add = [&](const std::string& patient, double day, double x, double left) {
    AuditedSession session{.name = patient + std::to_string(sessions.size()), .day = day, .found = {-x, 0.0, 0.0}};
    session.identity.patient_id = patient;
    session.setup_error = ErrorComponents{x, 0.0, 0.0, 0.0, 0.0, 0.0};
    session.used = {-x + left, 0.0, 0.0};
    sessions.push_back(session);
  };
  add("A", 1.4, 1.0, 1.0);
  add("B", 1.5, -2.0, 0.0);
  add("A", 2.4, 3.0, 1.0);
  add("B", 2.5, 0.0, 2.0);
  const SetupAudit audit = audit_of(sessions);
  ASSERT_TRUE(audit.uncorrected && audit.corrected);
  EXPECT_DOUBLE_EQ(audit.uncorrected->margin_mm[0], 2.5 * std::sqrt(4.5) + 0.7 * std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(audit.corrected->errors.mean[0], 1.0);
  EXPECT_DOUBLE_EQ(audit.corrected->margin_mm[0], 0.7 * 1.0) << "random errors 0 and sqrt(2), means alike";
  // A second session of a day shows what the shift has left, not how the patient was set up.
  add("B", 2.6, 50.0, 0.0);
  sessions.back().is_first_of_day = false;
  EXPECT_DOUBLE_EQ(audit_of(sessions).uncorrected->errors.mean[0], 0.5);
}

// As where one column of a spreadsheet was sorted.
TEST(SetupAudit, NoticesShiftsOfOtherSessions) {
  std::vector<AuditedSession> sessions = audited(made_archive(8, 0.0, false));
  EXPECT_FALSE(audit_of(sessions).axes[1].looks_unrelated);
  const CouchAxes first = sessions.front().used;
  for (std::size_t n = 0; n + 1 < sessions.size(); ++n) sessions[n].used[1] = sessions[n + 1].used[1];
  sessions.back().used[1] = first[1];
  const SetupAudit audit = audit_of(sessions);
  EXPECT_TRUE(audit.axes[1].looks_unrelated);
  EXPECT_FALSE(audit.axes[0].looks_unrelated || audit.axes[2].looks_unrelated);
  EXPECT_THAT(audit_text(audit), testing::HasSubstr("longitudinal: the used shifts lie hardly nearer"));
}

TEST(SetupAudit, NoticesADisplayThatCountsTheOtherWay) {
  std::vector<AuditedSession> sessions = audited(made_archive(8, 0.0, false));
  for (AuditedSession& session : sessions) session.used[2] = -*session.used[2];
  const SetupAudit audit = audit_of(sessions);
  EXPECT_TRUE(audit.axes[2].looks_opposite);
  EXPECT_FALSE(audit.axes[0].looks_opposite || audit.axes[1].looks_opposite);
}

}  // namespace
}  // namespace isoshift::setup_audit_test
