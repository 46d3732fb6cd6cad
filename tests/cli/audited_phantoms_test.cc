// A year in review on phantoms that were really registered: 60 fractions, of which the clinic's shifts are made up.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "base/output_folder.h"
#include "cli/console.h"
#include "setup/shown_shift.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"
#include "workflow/audit_setup/audit_words.h"
#include "workflow/audit_setup/used_shifts.h"
#include "workflow/register/truth.h"
#include "workflow/results_below.h"

namespace isoshift::audited_phantoms_test {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

constexpr int kPatients = 6, kFractions = 10;
constexpr double kDriftMmPerDay = 0.25;

struct Fraction {
  std::string session;
  int patient = 0, day = 0;
  bool is_accepted = true;       // otherwise the audit leaves it out
  std::array<double, 6> used{};  // lateral, longitudinal, vertical, yaw, pitch, roll
};

class AuditedPhantomsCommandTest : public testing::Test {
 protected:
  // Patients that lie off by a few mm, each in a way of its own, on the same ten days.
  void make_and_register() {
    for (int patient = 0; patient < kPatients; ++patient) {
      const CommandOutcome made = run_command(
          {"phantom", "-o", study_of(patient).string(), "--fractions", fmt::format("{}", kFractions), "--seed",
           fmt::format("{}", patient + 1), "--translation",
           fmt::format("{},{},{}", 2 * patient - 5, 4 - patient, patient % 3 - 1), "--rotation", "0.5,-0.5,0.5"});
      ASSERT_EQ(made.exit_status, 0) << made.err;
    }
    const CommandOutcome batch =
        run_command({"batch", (folder_ / "studies").string(), "-o", (folder_ / "results").string()});
    ASSERT_THAT(batch.exit_status, testing::AnyOf(kExitAccepted, kExitReview)) << batch.err;
  }

  std::filesystem::path study_of(int patient) const { return folder_ / "studies" / fmt::format("p{}", patient + 1); }

  // What would have put every patient right, off by what a clinic errs (0.4 mm, 0.3 degrees), in the order of time.
  std::vector<Fraction> used_shifts() {
    std::mt19937_64 generator(20261127);
    std::normal_distribution<double> normal;
    std::map<std::string, int> days_of_patient;
    std::map<std::string, int> numbers;
    for (int patient = 0; patient < kPatients; ++patient) numbers[fmt::format("PHANTOM{}", patient + 1)] = patient;
    std::vector<Fraction> fractions;
    for (auto& [name, result] : results_below(folder_ / "results").results) {
      Fraction one{.session = name,
                   .patient = numbers.at(result.identity.patient_id),
                   .day = days_of_patient[result.identity.patient_id]++,
                   .is_accepted = result.verdict() == Verdict::kAccepted};
      const std::string truth = one.day == 0 ? "truth.json" : fmt::format("truth_F{:02}.json", one.day + 1);
      result.setup_error = read_setup_error(study_of(one.patient) / truth);
      const ShownShift needed = shown_shift(result);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        one.used[axis] = needed.couch_mm[axis].value() + 0.4 * normal(generator);
        one.used[axis + 3] = needed.couch_deg[axis] + 0.3 * normal(generator);
      }
      one.used[1] += kDriftMmPerDay * one.day;
      fractions.push_back(one);
    }
    return fractions;
  }

  static Fraction& largest_along(std::vector<Fraction>& fractions, std::size_t axis, int patient) {
    return *std::ranges::max_element(fractions, {}, [&](const Fraction& one) {
      return one.patient == patient && one.is_accepted ? std::abs(one.used[axis]) : -1.0;
    });
  }

  void write_table(const std::vector<Fraction>& fractions) {
    std::string csv = used_shifts_header() + "\n";
    for (const Fraction& one : fractions) csv += fmt::format("{},{:.1f}\n", one.session, fmt::join(one.used, ","));
    write_text(folder_ / "used.csv", csv);
  }

  TemporaryFolder folder_;
};

TEST_F(AuditedPhantomsCommandTest, DriftSwapAndWrongSignsAreFoundAndNothingElse) {
  make_and_register();
  std::vector<Fraction> fractions = used_shifts();
  ASSERT_EQ(fractions.size(), static_cast<std::size_t>(kPatients * kFractions));
  // Patient 1 got on one day what patient 6 needed; patients 2 and 3 were moved the wrong way once.
  Fraction& swapped = largest_along(fractions, 0, 0);
  const auto other = std::ranges::find_if(fractions, [&](const Fraction& one) {
    return one.patient == kPatients - 1 && one.day == swapped.day && one.is_accepted;
  });
  ASSERT_NE(other, fractions.end());
  swapped.used = other->used;
  std::map<std::string, std::string> planted = {
      {swapped.session, "swapped patient: the used shift is that of session " + other->session}};
  for (const int patient : {1, 2}) {
    const std::size_t axis = patient == 1 ? 0 : 1;
    Fraction& turned = largest_along(fractions, axis, patient);
    ASSERT_GT(std::abs(turned.used[axis]), 2.5);
    turned.used[axis] = -turned.used[axis];
    planted[turned.session] = std::string("wrong sign of ") + kCouchAxes[axis];
  }
  write_table(fractions);

  const CommandOutcome outcome = run_command(
      {"qa", "audit-setup", (folder_ / "results").string(), "--used", (folder_ / "used.csv").string(), "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const Json audit = Json::parse(outcome.out);
  const auto accepted = std::ranges::count_if(fractions, &Fraction::is_accepted);
  EXPECT_EQ(audit["counted"], accepted);
  EXPECT_GE(accepted, 50);
  for (const Json& session : audit["sessions"]) {
    const std::string name = session["session"];
    const auto found = planted.find(name);
    if (found == planted.end())
      EXPECT_TRUE(session["outlier"].is_null()) << session.dump(2);
    else if (session["outlier"].is_null())
      ADD_FAILURE() << name << " is not found: " << found->second;
    else
      EXPECT_THAT(session["outlier"]["explanation"].get<std::string>(), HasSubstr(found->second));
  }
  for (const auto& [axis, agreement] : audit["agreement"].items())
    EXPECT_EQ(agreement["drift"]["is_significant"], axis == "longitudinal_mm") << axis << agreement;
  EXPECT_NEAR(audit["agreement"]["longitudinal_mm"]["drift"]["slope_per_30_days"].get<double>(), 30.0 * kDriftMmPerDay,
              2.0);
}

}  // namespace
}  // namespace isoshift::audited_phantoms_test
