// What the program says about itself: help, completion, and what a mistyped word probably meant.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "cli/help_formatter.h"
#include "cli/isoshift.h"
#include "cli/suggestion.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::help_test {
namespace {

using testing::StartsWith;

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// Every command as it is called: {"room", "watch"}.
std::vector<std::vector<std::string>> commands_below(const std::vector<std::string>& path) {
  std::vector<std::string> words = path;
  words.emplace_back("--help");
  std::vector<std::vector<std::string>> commands = {path};
  bool in_options = true;
  for (const std::string& line : lines_of(run_command(words).out)) {
    if (line.ends_with(':')) in_options = line == "Options:" || line == "Example:" || line == "Positionals:";
    if (in_options || line.size() < 3 || !line.starts_with("  ") || line[2] == ' ') continue;
    std::vector<std::string> below = path;
    below.push_back(line.substr(2, line.find(' ', 2) - 2));
    if (below.back().starts_with('-')) continue;
    if (path.empty() && (below.back() == "room" || below.back() == "qa"))
      std::ranges::copy(commands_below(below), std::back_inserter(commands));
    else
      commands.push_back(below);
  }
  return commands;
}

TEST(HelpTest, NoLineIsWiderThanATerminal) {
  const auto commands = commands_below({});
  EXPECT_EQ(commands.size(), 1 + 14 + 2 + 5 + 4);
  for (std::vector<std::string> words : commands) {
    words.emplace_back("--help");
    const CommandOutcome outcome = run_command(words);
    ASSERT_EQ(outcome.exit_status, 0) << testing::PrintToString(words) << outcome.err;
    for (const std::string& line : lines_of(outcome.out)) EXPECT_LE(line.size(), 80) << line;
  }
}

TEST(HelpTest, TheFirstScreenShowsSixteenCommandsInFourGroups) {
  const std::vector<std::string> lines = lines_of(run_command({"--help"}).out);
  const auto first = std::ranges::find(lines, "Register:");
  const auto is_command = [](const std::string& line) {
    return line.size() > 2 && line.starts_with("  ") && line[2] != ' ';
  };
  EXPECT_EQ(std::count_if(first, lines.end(), is_command), 16);
  EXPECT_EQ(std::count_if(first, lines.end(), [](const std::string& line) { return line.ends_with(':'); }), 4);
}

TEST(HelpTest, HelpIsACommandToo) {
  EXPECT_EQ(run_command({"help", "room", "watch"}).out, run_command({"room", "watch", "--help"}).out);
  EXPECT_EQ(run_command({"help"}).out, run_command({"--help"}).out);
  EXPECT_EQ(run_command({"help", "help"}).out, run_command({"--help"}).out);
  EXPECT_EQ(run_command({"help", "register"}).exit_status, 0);
}

TEST(HelpTest, ExamplesThatAreTooLongStayCommands) {
  EXPECT_EQ(wrapped("  isoshift register exported/ -o result    # finds the parts of the study", 60),
            "  # finds the parts of the study\n  isoshift register exported/ -o result");
  EXPECT_EQ(wrapped("  isoshift register exported/ -o result --site linac3.json", 40),
            "  isoshift register exported/ -o \\\n      result --site linac3.json");
  EXPECT_EQ(wrapped("one two three four", 25, 5), "     one two three four");
  EXPECT_EQ(wrapped("one two three four five six", 25, 5), "     one two three four\n     five six");
}

TEST(HelpTest, MistypedWordsAreNamedWithWhatTheyProbablyMeantBeforeWhatIsMissing) {
  const std::pair<std::vector<std::string>, std::string> mistakes[] = {
      {{"regsiter", "study"}, "isoshift has no command regsiter; did you mean isoshift register?"},
      {{"watch", "w.json"}, "isoshift has no command watch; did you mean isoshift room watch?"},
      {{"qa", "comission"}, "isoshift qa has no command comission; did you mean isoshift qa commission?"},
      {{"hlep"}, "isoshift has no command hlep; did you mean isoshift help?"},
      {{"xyzzy"}, "isoshift has no command xyzzy; its commands are inspect, register,"},
      {{"room"}, "isoshift room needs a command: watch, serve, release, delete, audit\n"},
      {{"--verison"}, "isoshift has no flag --verison; did you mean --version?\n"},
      {{"register", "study", "--ovrwrite"}, "isoshift register has no flag --ovrwrite; did you mean --overwrite?\n"},
      {{"phantom", "-o", "x", "--voxel=4"}, "isoshift phantom has no flag --voxel; did you mean --voxel-mm?\n"},
      {{"register", "study", "-q"}, "isoshift register has no flag -q\n"},
      {{"register", "study"}, "--output is required\n       isoshift register --help explains the flags\n"},
      {{"register", "study", "-oout", "more"}, "isoshift register does not expect more\n"},
      {{"phantom", "--translation", "-1,-.5,2", "--photons", "many"}, "Could not convert: --photons = many"}};
  for (const auto& [words, message] : mistakes) {
    const CommandOutcome outcome = run_command(words);
    EXPECT_EQ(outcome.exit_status, 2) << testing::PrintToString(words);
    EXPECT_THAT(outcome.err, StartsWith("error: " + message));
  }
}

TEST(HelpTest, BashCompletes) {
  const TemporaryFolder folder;
  write_manual(folder.path());
  const auto completed = [&](const std::string& words) {
    return run_shell("bash -c 'source " + (folder.path() / "isoshift.bash").string() + "; COMP_WORDS=(" + words +
                     "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _isoshift; echo ${COMPREPLY[@]}'")
        .out;
  };
  EXPECT_EQ(completed("isoshift re"), "register report\n");
  EXPECT_EQ(completed("isoshift room wa"), "watch\n");
  EXPECT_EQ(completed("isoshift register study --pres"), "--preset\n");
  EXPECT_EQ(completed("isoshift register study --preset s"), "setup\n");
  EXPECT_EQ(completed("isoshift qa commission --pos"), "--positions\n");
  EXPECT_EQ(completed("isoshift he"), "help\n");
  EXPECT_EQ(completed("isoshift help room wa"), "watch\n");
  EXPECT_EQ(completed("isoshift register --preset = s"), "setup\n") << "as bash splits --preset=s";
}

TEST(SuggestionTest, IsWhatDiffersByAThirdOfTheLettersAtMost) {
  const std::vector<std::string> words = {"watch", "batch", "--overwrite"};
  EXPECT_EQ(suggestion("wacth", words), "watch");
  EXPECT_EQ(suggestion("bath", words), "batch");
  EXPECT_EQ(suggestion("--ovrwrit", words), "--overwrite");
  EXPECT_EQ(suggestion("drr", words), "");
}

}  // namespace
}  // namespace isoshift::help_test
