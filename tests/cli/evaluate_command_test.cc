#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "cli/commands/commands.h"
#include "tests/support/small_study.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_study.h"
#include "workflow/evaluate/evaluation_files.h"

namespace isoshift::evaluate_command_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

std::string content_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::vector<std::string> lines_of(const std::filesystem::path& path) {
  std::istringstream text(content_of(path));
  std::vector<std::string> lines;
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

std::vector<std::string> fields_of(const std::string& line) {
  std::istringstream text(line);
  std::vector<std::string> fields;
  for (std::string field; std::getline(text, field, ',');) fields.push_back(field);
  return fields;
}

// The runs of an evaluation in the order of their numbers, all but their times.
std::vector<std::string> runs_without_times(const std::filesystem::path& folder) {
  const std::vector<std::string> lines = lines_of(folder / "runs.csv");
  const std::vector<std::string> header = fields_of(lines.at(0));
  std::vector<std::string> runs;
  for (std::size_t n = 1; n < lines.size(); ++n) {
    const std::vector<std::string> fields = fields_of(lines[n]);
    std::string run;
    for (std::size_t f = 0; f < fields.size(); ++f)
      if (f >= header.size() || !header[f].starts_with("seconds")) run += fields[f] + ",";
    runs.push_back(run);
  }
  std::ranges::sort(runs);
  return runs;
}

class EvaluateCommandTest : public testing::Test {
 protected:
  // The program on four starts, quickly.
  CommandOutcome evaluate(const std::filesystem::path& output, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"evaluate", tiny_study().path().string(),
                                          "--truth",  tiny_study().truth().string(),
                                          "-o",       output.string(),
                                          "--preset", "fast"};
    if (std::ranges::find(more, "--starts") == more.end()) arguments.insert(arguments.end(), {"--starts", "4"});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments);
  }

  TemporaryFolder folder_;
};

TEST_F(EvaluateCommandTest, WritesRunsSummaryAndCharts) {
  const CommandOutcome outcome = evaluate(folder_ / "evaluation", {"--jobs", "2"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const std::vector<std::string> lines = lines_of(folder_ / "evaluation" / "runs.csv");
  ASSERT_EQ(lines.size(), 5U);
  const std::vector<std::string> header = fields_of(lines[0]);
  EXPECT_THAT(lines[0], testing::StartsWith("run,start_mtre_mm,mtre_mm,"));
  for (std::size_t n = 1; n < lines.size(); ++n) EXPECT_GE(fields_of(lines[n]).size(), header.size()) << lines[n];

  const auto summary = nlohmann::json::parse(content_of(folder_ / "evaluation" / "summary.json"));
  EXPECT_EQ(summary["runs"], 4);
  int successes = 0;
  for (std::size_t n = 1; n < lines.size(); ++n) successes += std::stod(fields_of(lines[n])[2]) < 2.0 ? 1 : 0;
  EXPECT_EQ(summary["successes"], successes);
  for (const char* chart : {"success.svg", "errors.svg"})
    EXPECT_THAT(content_of(folder_ / "evaluation" / chart), HasSubstr("<svg")) << chart;
  EXPECT_THAT(outcome.out, HasSubstr("| evaluation |"));
  EXPECT_THAT(outcome.out, HasSubstr(fmt::format("{}/4 (", successes)));
}

TEST_F(EvaluateCommandTest, StoppedAndStartedAgainGivesTheSameRuns) {
  ASSERT_EQ(evaluate(folder_ / "whole").exit_status, 0);
  // As it is left when it is stopped: two runs and half of a third, and no summary yet.
  const std::vector<std::string> lines = lines_of(folder_ / "whole" / "runs.csv");
  std::filesystem::create_directory(folder_ / "stopped");
  for (const char* file : {"evaluation.json", "bodies.csv"})
    std::filesystem::copy(folder_ / "whole" / file, folder_ / "stopped" / file);
  std::ofstream(folder_ / "stopped" / "runs.csv") << lines[0] << "\n"
                                                  << lines[1] << "\n"
                                                  << lines[2] << "\n"
                                                  << lines[3].substr(0, lines[3].size() / 2);
  const CommandOutcome outcome = evaluate(folder_ / "stopped");
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_EQ(runs_without_times(folder_ / "stopped"), runs_without_times(folder_ / "whole"));
  // What had ended was not made again: its times are those of then.
  EXPECT_EQ(lines_of(folder_ / "stopped" / "runs.csv")[1], lines[1]);
  EXPECT_EQ(lines_of(folder_ / "stopped" / "runs.csv")[2], lines[2]);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "stopped" / "summary.json"));
}

// Killed between its first files, and then read only.
TEST_F(EvaluateCommandTest, AnEvaluationThatHadHardlyBegunIsContinued) {
  ASSERT_EQ(evaluate(folder_ / "whole").exit_status, 0);
  std::filesystem::create_directory(folder_ / "begun");
  std::filesystem::copy(folder_ / "whole" / "evaluation.json", folder_ / "begun" / "evaluation.json");
  std::ofstream(folder_ / "begun" / ".runs.csv.77.partial") << "0,";
  const CommandOutcome outcome = evaluate(folder_ / "begun");
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_EQ(runs_without_times(folder_ / "begun"), runs_without_times(folder_ / "whole"));

  const std::string cut = content_of(folder_ / "begun" / "runs.csv") + "0,1,2";
  std::ofstream(folder_ / "begun" / "runs.csv") << cut;
  EXPECT_EQ(run_command({"evaluate", "--table", (folder_ / "begun").string()}).exit_status, 0);
  EXPECT_EQ(content_of(folder_ / "begun" / "runs.csv"), cut) << "reading has changed it";
}

TEST_F(EvaluateCommandTest, AWholeOneStartedAgainIsLeftAsItIs) {
  ASSERT_EQ(evaluate(folder_ / "evaluation").exit_status, 0);
  const std::string runs = content_of(folder_ / "evaluation" / "runs.csv");
  const std::string summary = content_of(folder_ / "evaluation" / "summary.json");
  const CommandOutcome again = evaluate(folder_ / "evaluation");
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(content_of(folder_ / "evaluation" / "runs.csv"), runs);
  EXPECT_EQ(content_of(folder_ / "evaluation" / "summary.json"), summary);
}

TEST_F(EvaluateCommandTest, RunsLostFromAWholeOneAreMadeAgain) {
  ASSERT_EQ(evaluate(folder_ / "evaluation").exit_status, 0);
  const std::vector<std::string> expected = runs_without_times(folder_ / "evaluation");
  const std::vector<std::string> lines = lines_of(folder_ / "evaluation" / "runs.csv");
  std::ofstream(folder_ / "evaluation" / "runs.csv") << lines[0] << "\n" << lines[4] << "\n" << lines[2].substr(0, 20);
  const CommandOutcome again = evaluate(folder_ / "evaluation");
  EXPECT_EQ(again.exit_status, 0) << again.err;
  EXPECT_EQ(runs_without_times(folder_ / "evaluation"), expected);
}

TEST_F(EvaluateCommandTest, ALineThatIsBrokenInTheMiddleIsNamed) {
  ASSERT_EQ(evaluate(folder_ / "evaluation", {"--starts", "1"}).exit_status, 0);
  const std::vector<std::string> lines = lines_of(folder_ / "evaluation" / "runs.csv");
  std::ofstream(folder_ / "evaluation" / "runs.csv") << lines[0] << "\n0,1.5,oops\n" << lines[1] << "\n";
  const CommandOutcome outcome = run_command({"evaluate", "--table", (folder_ / "evaluation").string()});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("runs.csv: line 2 cannot be read: 0,1.5,oops"));
}

TEST_F(EvaluateCommandTest, AnotherEvaluationIsNotContinued) {
  ASSERT_EQ(evaluate(folder_ / "evaluation", {"--starts", "1"}).exit_status, 0);
  const std::string runs = content_of(folder_ / "evaluation" / "runs.csv");
  for (const std::vector<std::string>& more : {std::vector<std::string>{"--starts", "2"},
                                               {"--starts", "1", "--seed", "7"},
                                               {"--starts", "1", "--start-seed", "7"},
                                               {"--starts", "1", "--dof", "translation"},
                                               {"--starts", "1", "--threshold-hu", "-500"},
                                               {"--starts", "1", "--image", tiny_study().image(0).string()}}) {
    const CommandOutcome outcome = evaluate(folder_ / "evaluation", more);
    EXPECT_EQ(outcome.exit_status, 1) << testing::PrintToString(more);
    EXPECT_THAT(outcome.err, HasSubstr("holds another evaluation (evaluation.json says which)"));
  }
  EXPECT_EQ(content_of(folder_ / "evaluation" / "runs.csv"), runs);
}

TEST_F(EvaluateCommandTest, ATruthAboutAnotherIsocenterIsRefused) {
  ASSERT_EQ(evaluate(folder_ / "evaluation", {"--starts", "1"}).exit_status, 0);
  const CommandOutcome outcome = evaluate(folder_ / "evaluation", {"--starts", "1", "--isocenter", "-2.5,38,-410"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("truth.json: its isocenter is (-12.50, 38.00, -410.00), and that of the study"));
}

TEST_F(EvaluateCommandTest, AFolderOfSomethingElseIsLeftAlone) {
  std::filesystem::create_directory(folder_ / "notes");
  std::ofstream(folder_ / "notes" / "diary.txt") << "mine";
  const CommandOutcome outcome = evaluate(folder_ / "notes", {"--starts", "1"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("exists and holds no evaluation"));
  EXPECT_THAT(lines_of(folder_ / "notes" / "diary.txt"), ElementsAre("mine"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "notes" / "runs.csv"));
}

TEST_F(EvaluateCommandTest, TwoJobsFindWhatOneFinds) {
  ASSERT_EQ(evaluate(folder_ / "one", {"--jobs", "1"}).exit_status, 0);
  ASSERT_EQ(evaluate(folder_ / "two", {"--jobs", "2"}).exit_status, 0);
  EXPECT_EQ(runs_without_times(folder_ / "two"), runs_without_times(folder_ / "one"));
}

TEST_F(EvaluateCommandTest, TheTableHasARowPerFolder) {
  ASSERT_EQ(evaluate(folder_ / "first", {"--starts", "1"}).exit_status, 0);
  ASSERT_EQ(evaluate(folder_ / "second", {"--starts", "2"}).exit_status, 0);
  // A folder may be named with a slash at its end.
  const CommandOutcome table =
      run_command({"evaluate", "--table", (folder_ / "first").string(), (folder_ / "second").string() + "/"});
  ASSERT_EQ(table.exit_status, 0) << table.err;
  EXPECT_THAT(table.out, HasSubstr("| first "));
  EXPECT_THAT(table.out, HasSubstr("| second "));
  EXPECT_THAT(table.out, HasSubstr("/1 ("));
  EXPECT_THAT(table.out, HasSubstr("/2 ("));
  EXPECT_EQ(std::ranges::count(table.out, '\n'), 4);  // with the head's two lines

  const CommandOutcome none = run_command({"evaluate", "--table", (folder_ / "nowhere").string()});
  EXPECT_EQ(none.exit_status, 1);
  EXPECT_THAT(none.err, HasSubstr("is this the folder of an evaluation?"));
}

TEST_F(EvaluateCommandTest, ErrorsOfSuccessesNeedSuccesses) {
  EXPECT_THAT(evaluation_table({{"none", {.runs = 3}}}), HasSubstr("| 0/3 (0.0 %) | - | - | - | - | at least 0 mm |"));
  EXPECT_THAT(evaluation_table({{"one", {.runs = 3, .successes = 1, .mean_mm = 0.5, .median_mm = 0.5}}}),
              HasSubstr("| 1/3 (33.3 %) | 0.50 mm | 0.50 mm |"));
}

TEST_F(EvaluateCommandTest, NeedsATruthAndAFolder) {
  const std::string study_folder = tiny_study().path().string();
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"evaluate", study_folder, "-o", (folder_ / "a").string()},
        {"evaluate", study_folder, "--truth", tiny_study().truth().string()}}) {
    const CommandOutcome outcome = run_command(arguments);
    EXPECT_EQ(outcome.exit_status, 2);
    EXPECT_THAT(outcome.err, HasSubstr("needs --truth and -o"));
  }
  EXPECT_EQ(evaluate(folder_ / "a", {"--starts", "0"}).exit_status, 2);
  EXPECT_EQ(evaluate(folder_ / "a", {"--distance", "-3"}).exit_status, 2);
  EXPECT_EQ(evaluate(folder_ / "a", {"--jobs", "0"}).exit_status, 2);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "a"));
}

TEST_F(EvaluateCommandTest, StartsOfThePaperAre25MmAway) {
  ASSERT_EQ(evaluate(folder_ / "paper", {"--series", "paper", "--starts", "1", "--jobs", "1"}).exit_status, 0);
  EXPECT_GE(std::stod(fields_of(lines_of(folder_ / "paper" / "runs.csv")[1])[1]), 24.0);
}

TEST(RegionOptionsTest, AnUnknownStructureIsAnErrorThatListsWhatThereIs) {
  const SmallStudy study;
  const auto square = rectangle({-12, 38, -410}, 40, 40);
  auto above = square;
  for (Eigen::Vector3d& corner : above) corner.z() += 6.0;
  draw(study, {{"Spine", {square, above}}, {"Mandible", {square, above}}});
  for (const char* flag : {"--structure", "--exclude"}) {
    const CommandOutcome outcome = register_study(study, {flag, "Liver"});
    EXPECT_EQ(outcome.exit_status, 1) << flag;
    EXPECT_THAT(outcome.err, HasSubstr("Liver"));
    EXPECT_THAT(outcome.err, HasSubstr("Spine"));
    EXPECT_THAT(outcome.err, HasSubstr("Mandible"));
    EXPECT_FALSE(std::filesystem::exists(study.output()));
  }
}

TEST(RegionOptionsTest, AStructureOfAStudyWithoutAnyIsAnError) {
  const SmallStudy study;
  const CommandOutcome outcome = register_study(study, {"--structure", "Spine"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("structure Spine: the study holds no RT Structure Set"));
}

TEST(RegionOptionsTest, ARectangleNeedsALabelOfAnXrayAndFourNumbers) {
  const SmallStudy study;
  for (const char* rectangle :
       {"KV_G000", "KV_G000=1,2,3", "KV_G000=1,2,3,x", "KV_G000=10,10,5,20", "KV_G000=1,2,30,40,5", "OTHER=10,10,80,80",
        "KV_G000=-5,10,80,80", "KV_G000=10,10,80,4000"}) {
    const CommandOutcome outcome = register_study(study, {"--rectangle", rectangle});
    EXPECT_EQ(outcome.exit_status, 2) << rectangle;
    EXPECT_THAT(outcome.err, HasSubstr(fmt::format("--rectangle {}: ", rectangle)));
  }
  EXPECT_THAT(register_study(study, {"--preset", "fast", "--rectangle", "KV_G000=10,10,80,80"}).exit_status, 3);
}

TEST(RegionOptionsTest, ADistanceThatIsNoneIsAUsageError) {
  const SmallStudy study;
  for (const char* distance : {"0", "-5", "nan", "inf", "100000"})
    EXPECT_EQ(register_study(study, {"--around-isocenter", distance}).exit_status, 2) << distance;
}

}  // namespace
}  // namespace isoshift::evaluate_command_test
