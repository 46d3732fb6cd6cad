// Table 2 of the founding paper, from the command to the table.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "cli/commands/commands.h"
#include "tests/support/tiny_study.h"
#include "workflow/evaluate/table2_configurations.h"

namespace isoshift::table2_test {
namespace {

using testing::HasSubstr;

std::vector<std::string> lines_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(file, line);) lines.push_back(line);
  return lines;
}

const Table2Configuration& named(std::string_view name) {
  return *std::ranges::find(table2_configurations(), name, &Table2Configuration::name);
}

TEST(Table2Configurations, HaveNamesOfTheirOwnAndSearchesThatAreAllowed) {
  std::set<std::string> names;
  for (const Table2Configuration& configuration : table2_configurations()) {
    names.insert(configuration.name);
    const RegistrationOptions search = request_of(configuration, {}).search.registration();  // throws if not
    EXPECT_EQ(search.preset, "paper") << configuration.name;
    ASSERT_EQ(search.stages.size(), static_cast<std::size_t>(configuration.searches)) << configuration.name;
    EXPECT_EQ(to_string(search.stages.back().optimizer), configuration.optimizer);
    EXPECT_EQ(search.stages.back().relative_tolerance, configuration.relative_tolerance);
  }
  EXPECT_EQ(names.size(), table2_configurations().size());
}

TEST(Table2Configurations, ReadTwentyFiveMillimetersInThreeWays) {
  const auto starts = [](const char* name) {
    return start_poses({Eigen::Isometry3d::Identity()}, protocol_of(named(name), 150));
  };
  ASSERT_EQ(starts("cpu-mi").size(), 150U);
  for (const StartPose& start : starts("cpu-mi")) {
    EXPECT_NEAR(start.setup_error.translation().norm(), 25.0, 1e-9);
    EXPECT_TRUE(start.setup_error.linear().isIdentity(1e-12));
  }
  for (const StartPose& start : starts("cpu-mi-mtre")) EXPECT_NEAR(start.mtre_mm, 25.0, 1e-6);
  double least_mm = 25.0, most_mm = 0.0;
  for (const StartPose& start : starts("cpu-mi-up-to")) {
    least_mm = std::min(least_mm, start.mtre_mm);
    most_mm = std::max(most_mm, start.mtre_mm);
  }
  EXPECT_LT(least_mm, 1.0);
  EXPECT_GT(most_mm, 24.0);
  EXPECT_LE(most_mm, 25.0);
}

TEST(Table2Configurations, CountStartsButNeverMoreThanIsAsked) {
  EXPECT_EQ(protocol_of(named("cpu-mi"), 1000).count, 150);
  EXPECT_EQ(protocol_of(named("splat-mi"), 1000).count, 20);
  EXPECT_EQ(protocol_of(named("splat-mi"), 5).count, 5);
}

// GPU flags are of the configurations that need one: the CPU refuses them.
TEST(Table2Configurations, TheDeviceIsThatOfOpenGlAlone) {
  RegistrationRequest common;
  common.rendering.gl = "software";
  EXPECT_FALSE(request_of(named("cpu-mi"), common).rendering.gl);
  EXPECT_EQ(request_of(named("splat-mi"), common).rendering.gl, "software");
}

class Table2CommandTest : public testing::Test {
 protected:
  CommandOutcome table2(const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"evaluate", tiny_study().path().string(),
                                          "--truth",  tiny_study().truth().string(),
                                          "-o",       output().string(),
                                          "--table2", "--starts",
                                          "2"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments);
  }
  std::filesystem::path output() const { return folder_ / "table2"; }

  TemporaryFolder folder_;
};

TEST_F(Table2CommandTest, WritesAFolderPerConfigurationAndOneTable) {
  const CommandOutcome outcome = table2({"--only", "cpu-mi", "--only", "cpu-src-levenberg-marquardt"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const std::vector<std::string> table = lines_of(output() / "table2.md");
  ASSERT_EQ(table.size(), 4U);
  EXPECT_THAT(table[2], testing::StartsWith("| cpu-mi | 25 mm without rotation | 2 | cpu | mi | nelder-mead | 2 | "));
  EXPECT_THAT(table[3], testing::StartsWith("| cpu-src-levenberg-marquardt | "));
  for (const std::string& row : table) EXPECT_THAT(outcome.out, HasSubstr(row));
  const std::vector<std::string> csv = lines_of(output() / "table2.csv");
  ASSERT_EQ(csv.size(), 3U);
  EXPECT_EQ(std::ranges::count(csv[0], ','), std::ranges::count(csv[2], ','));
  EXPECT_EQ(lines_of(output() / "cpu-mi" / "runs.csv").size(), 3U);

  const auto configuration = [&](const char* name) {
    std::ifstream file(output() / name / "evaluation.json");
    return nlohmann::json::parse(file);
  };
  EXPECT_EQ(configuration("cpu-mi")["max_rotation_deg"], 0.0);
  EXPECT_EQ(configuration("cpu-mi")["distance_mm"], 25.0);
  EXPECT_EQ(configuration("cpu-mi")["seed_per_run"], true);
  EXPECT_EQ(configuration("cpu-src-levenberg-marquardt")["optimizer"], "levenberg-marquardt");
}

TEST_F(Table2CommandTest, GoesOnWhereItWasStopped) {
  ASSERT_EQ(table2({"--only", "cpu-mi"}).exit_status, 0);
  const std::vector<std::string> lines = lines_of(output() / "cpu-mi" / "runs.csv");
  std::ofstream(output() / "cpu-mi" / "runs.csv") << lines[0] << "\n" << lines[1] << "\n";
  const CommandOutcome again = table2({"--only", "cpu-mi", "--only", "cpu-mi-one-view"});
  ASSERT_EQ(again.exit_status, 0) << again.err;
  const std::vector<std::string> after = lines_of(output() / "cpu-mi" / "runs.csv");
  ASSERT_EQ(after.size(), 3U);
  EXPECT_EQ(after[1], lines[1]);
  // Rows of earlier calls stay in the table.
  EXPECT_EQ(table2({"--only", "cpu-src"}).exit_status, 0);
  EXPECT_EQ(lines_of(output() / "table2.md").size(), 5U);
}

TEST_F(Table2CommandTest, OneViewIsJudgedByWhatItCanSee) {
  // A rectangle of the view that is left out is left out with it.
  const CommandOutcome outcome =
      table2({"--only", "cpu-mi-one-view", "--rectangle", "KV_G000=5,5,66,66", "--rectangle", "KV_G090=5,5,66,66"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  std::ifstream file(output() / "cpu-mi-one-view" / "evaluation.json");
  const auto configuration = nlohmann::json::parse(file);
  EXPECT_EQ(configuration["success_by"], "mRPD");
  EXPECT_EQ(configuration["images"].size(), 1U);
  EXPECT_EQ(configuration["rectangles"].size(), 1U);
}

// A table is of one study: here that of the first row has other X-rays than that of the second.
TEST_F(Table2CommandTest, RowsOfTwoStudiesAreNoTable) {
  ASSERT_EQ(table2({"--only", "cpu-mi"}).exit_status, 0);
  const std::filesystem::path file = output() / "cpu-mi" / "evaluation.json";
  nlohmann::json configuration;
  std::ifstream(file) >> configuration;
  configuration["images"][0] = "1.2.3";
  std::ofstream(file) << configuration.dump(2);
  const CommandOutcome outcome = table2({"--only", "cpu-src"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("its other evaluations are of another study"));
  EXPECT_FALSE(std::filesystem::exists(output() / "cpu-src")) << "it has begun";
}

// Killed before anything of the second row was written.
TEST_F(Table2CommandTest, ARowThatHadHardlyBegunIsMade) {
  std::filesystem::create_directories(output() / "cpu-mi");
  std::ofstream(output() / "cpu-mi" / ".evaluation.json.77.partial") << "{";
  const CommandOutcome outcome = table2({"--only", "cpu-mi"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
}

TEST_F(Table2CommandTest, JobsThatARowCannotHaveAreRefusedAtOnce) {
  EXPECT_EQ(table2({"--jobs", "2"}).exit_status, 2);
  EXPECT_FALSE(std::filesystem::exists(output())) << "rows of the CPU have begun";
}

TEST_F(Table2CommandTest, RefusesWhatAConfigurationSaysItself) {
  EXPECT_EQ(table2({"--preset", "setup"}).exit_status, 2);
  EXPECT_EQ(table2({"--renderer", "cpu"}).exit_status, 2);
  EXPECT_EQ(table2({"--only", "nothing"}).exit_status, 2);
  EXPECT_EQ(run_command({"evaluate", tiny_study().path().string(), "--truth", tiny_study().truth().string(), "-o",
                         output().string(), "--only", "cpu-mi"})
                .exit_status,
            2);
}

}  // namespace
}  // namespace isoshift::table2_test
